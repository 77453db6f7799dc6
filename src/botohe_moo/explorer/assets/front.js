// The chart of the front: all plans, those that are marked and pinned, and the one at hand.

const SYMBOLS = { choice: d3.symbolStar, miss: d3.symbolTimes, knee: d3.symbolDiamond,
  representative: d3.symbolTriangle };
const NEAR = 50; // pixels within which the pointer finds a plan

class FrontChart {
  constructor(svg) {
    this.svg = d3.select(svg);
    for (const layer of ["axes", "points", "symbols", "stalks", "pins", "hand"]) {
      this[layer] = this.svg.append("g").attr("class", layer);
    }
  }

  resize(width) {
    const height = Math.round(Math.min(0.7 * width, 440) * (width < 480 ? 0.75 : 1)); // the map is to be seen with it
    const [left, right, top, bottom] = [58, 16, 14, 44];
    const extent = (column, low, high) => {
      const [least, most] = d3.extent(data.objectives, (point) => point[column]);
      const room = 0.06 * (most - least || Math.abs(most) || 1);
      return d3.scaleLinear([Math.max(0, least - room), most + room], [low, high]);
    };
    this.x = extent(0, left, width - right);
    this.y = extent(1, height - bottom, top);
    Object.assign(this, { low: height - bottom, left });
    this.svg.attr("viewBox", `0 0 ${width} ${height}`).attr("aria-label", this.description());
    const across = d3.axisBottom(this.x).ticks(width / 90).tickSizeOuter(0);
    const up = d3.axisLeft(this.y).ticks(height / 60).tickSizeOuter(0);
    this.axes.selectAll("*").remove();
    this.axes.append("g").attr("transform", `translate(0,${this.low})`).call(across);
    this.axes.append("g").attr("transform", `translate(${left},0)`).call(up);
    this.axes.append("text").attr("class", "axis").attr("text-anchor", "end")
      .attr("x", width - right).attr("y", height - 6).text("expected reward");
    this.axes.append("text").attr("class", "axis").attr("text-anchor", "end")
      .attr("transform", `translate(13,${top}) rotate(-90)`).text("expected survivors");
    this.points.selectAll("circle").data(data.objectives).join("circle")
      .attr("class", "point").attr("r", data.ids.length > 150 ? 2.6 : 4)
      .attr("cx", (point) => this.x(point[0])).attr("cy", (point) => this.y(point[1]));
    this.drawMarks();
  }

  description() {
    const last = data.ids.length - 1;
    return `Front of ${data.ids.length} plans: from reward ${rewardOf(0)} with ${survivorsOf(0)} ` +
      `survivors to reward ${rewardOf(last)} with ${survivorsOf(last)} survivors.`;
  }

  place(plan) {
    return [this.x(data.objectives[plan][0]), this.y(data.objectives[plan][1])];
  }

  /** One symbol a plan, the first that it has. */
  drawMarks() {
    const drawn = data.marks.filter((mark) => SYMBOLS[mark.kind]);
    const first = d3.rollup(drawn, (marks) => marks[0], (mark) => mark.plan);
    this.symbols.selectAll("path").data([...first.values()]).join("path")
      .attr("class", (mark) => `mark ${mark.kind}`)
      .attr("d", (mark) => d3.symbol(SYMBOLS[mark.kind], 110)())
      .attr("transform", (mark) => `translate(${this.place(mark.plan)})`);
  }

  /** Show which plans meet the filters. */
  sift() {
    const met = new Set(matching);
    this.points.selectAll("circle").classed("out", (_, plan) => !met.has(plan));
  }

  show(plan) {
    const [x, y] = this.place(plan);
    this.hand.selectAll("path").data([plan]).join("path").attr("d", `M${this.left},${y}H${x}V${this.low}`);
    this.hand.selectAll("circle").data([plan]).join("circle").attr("r", 7).attr("cx", x).attr("cy", y);
    this.showPins();
  }

  /** A letter for each pin, right above its plan, higher where another is in the way. */
  showPins() {
    const taken = [];
    const flags = state.pins.map((plan, i) => ({ label: LETTERS[i], at: this.place(plan) }));
    for (const flag of d3.sort(flags, (one) => one.at[0])) {
      const [x, y] = flag.at;
      flag.to = [x + 12, Math.max(y - 20, 10)];
      while (taken.some(([a, b]) => Math.hypot(a - flag.to[0], b - flag.to[1]) < 19)) flag.to[0] += 8;
      taken.push(flag.to);
    }
    this.stalks.selectAll("path").data(flags).join("path").attr("d", (flag) => line([flag.at, flag.to]));
    markers(this.pins, flags, (flag) => `translate(${flag.to})`);
  }

  /** The plan that the pointer means, among those that meet the filters. */
  nearest(event) {
    const [x, y] = d3.pointer(event, this.svg.node());
    const away = (plan) => Math.hypot(this.place(plan)[0] - x, this.place(plan)[1] - y);
    const plan = d3.least(matching, away);
    return plan !== undefined && away(plan) < NEAR ? plan : null;
  }
}
