// The map of the site with the trails of one plan on it; small for pinned plans.

const DASHES = ["", "12 4", "5 3", "12 3 3 3", "3 2"];
const MANY = 1500; // arcs from which the ground is drawn on a canvas
const SHADES = 6; // of arcs, by danger
const FAINTEST = 0.6; // opacity of the safest arcs
const MOST_PIXELS = 16e6; // of the canvas, which browsers limit
const HOPS_LAST = 12_000; // milliseconds that an animation takes at most

/** Colour and dash of each robot; those that leave the base come first. */
function stylesOf(plan) {
  let leaving = 0;
  return trailsOf(plan).map((trail) => {
    const style = trail.length > 1 ? leaving++ : 0;
    const dash = DASHES[(style + Math.floor(style / 10)) % DASHES.length] || null;
    return { colour: `var(--robot-${style % 10})`, dash };
  });
}

class SiteMap {
  constructor(svg, canvas = null) {
    this.svg = d3.select(svg);
    this.canvas = canvas;
    for (const layer of ["arcs", "trails", "nodes", "names", "badges", "robots"]) {
      this[layer] = this.svg.append("g").attr("class", layer);
    }
  }

  resize(width, small = false) {
    const [xs, ys] = [0, 1].map((axis) => d3.extent(data.places, (place) => place[axis]));
    const [wide, high] = [xs[1] - xs[0], ys[1] - ys[0]];
    const margin = small ? 10 : 30;
    const height = width * Math.min(Math.max(high / (wide || high || 1), 0.35), 1.05);
    const scale = wide + high
      ? Math.min((width - 2 * margin) / (wide || 1e-9), (height - 2 * margin) / (high || 1e-9)) : 0;
    this.at = data.places.map(([x, y]) => [
      width / 2 + scale * (x - (xs[0] + xs[1]) / 2),
      height / 2 - scale * (y - (ys[0] + ys[1]) / 2), // y points up on a map
    ]);
    Object.assign(this, { width, height, small });
    this.svg.attr("viewBox", `0 0 ${width} ${height}`);
    const radius = this.nodeRadius();
    const most = d3.max(data.rewards) || 1;
    this.size = data.rewards.map((reward, node) =>
      node === data.base ? Math.max(1.1 * radius, this.small ? 3 : 5.5)
        : radius * (0.5 + 0.7 * Math.sqrt(reward / most)));
    this.lane = Math.min(Math.max(0.42 * radius, 1.3), 3.4);
    this.drawGround();
    this.drawNodes();
    if (!small) this.drawNames();
  }

  /** Nodes are as large as the narrower places allow. */
  nodeRadius() {
    const [least, most] = this.small ? [1.2, 4.5] : [2.2, 10];
    if (this.at.length < 2) return most;
    const tree = d3.Delaunay.from(this.at);
    const nearest = this.at.map((one, i) => d3.min(tree.neighbors(i), (j) => apart(one, this.at[j])) ?? 99);
    return Math.min(Math.max(0.34 * d3.quantile(nearest, 0.2), least), most);
  }

  /** All arcs; both directions are one line where they are equally dangerous. */
  drawGround() {
    const [tails, heads, codes] = data.arcs;
    const danger = new Map(tails.map((tail, i) => [`${tail} ${heads[i]}`, 1 - share(codes[i])]));
    const most = d3.max(danger.values()) || 1;
    const paths = Array.from({ length: SHADES }, () => []);
    tails.forEach((tail, i) => {
      const [head, own] = [heads[i], danger.get(`${tail} ${heads[i]}`)];
      const same = own === danger.get(`${head} ${tail}`);
      if (same && tail > head) return;
      const [from, to] = this.hop(tail, head, same ? 0 : 0.5 * this.lane);
      const oneWay = !danger.has(`${head} ${tail}`);
      const drawn = line([from, to]) + (oneWay ? arrowHead([from, to], this.small ? 3 : 5) : "");
      paths[Math.min(Math.floor((SHADES * own) / most), SHADES - 1)].push(drawn);
    });
    const shades = paths.map((found, shade) => ({ d: found.join(""), opacity: FAINTEST + 0.08 * shade }));
    const scale = (this.small ? 0.6 : 1) * (tails.length > 400 ? 0.8 : 1.4);
    const wide = ({ opacity }) => scale * (0.7 + 1.5 * (opacity - FAINTEST)); // less than trails
    if (this.canvas === null || tails.length <= MANY) {
      this.arcs.selectAll("path").data(shades).join("path").attr("d", (shade) => shade.d)
        .attr("stroke-opacity", (shade) => shade.opacity).attr("stroke-width", wide);
      return;
    }
    const dots = Math.min(window.devicePixelRatio || 1, Math.sqrt(MOST_PIXELS / (this.width * this.height)));
    this.canvas.width = this.width * dots;
    this.canvas.height = this.height * dots;
    const pen = this.canvas.getContext("2d");
    pen.scale(dots, dots);
    pen.strokeStyle = getComputedStyle(this.canvas).getPropertyValue("--arc");
    for (const shade of shades) {
      Object.assign(pen, { globalAlpha: shade.opacity, lineWidth: wide(shade) });
      pen.stroke(new Path2D(shade.d));
    }
  }

  /** From one node's edge to the other's, moved to the right of the way. */
  hop(tail, head, aside) {
    const [[x1, y1], [x2, y2]] = [this.at[tail], this.at[head]];
    const length = Math.hypot(x2 - x1, y2 - y1) || 1;
    const [dx, dy] = [(x2 - x1) / length, (y2 - y1) / length];
    const [from, to] = [tail, head].map((node) => Math.min(0.8 * this.size[node], 0.3 * length));
    return [
      [x1 + dx * from - dy * aside, y1 + dy * from + dx * aside],
      [x2 - dx * to - dy * aside, y2 - dy * to + dx * aside],
    ];
  }

  drawNodes() {
    this.nodes.selectAll("*").remove();
    const others = d3.range(this.at.length).filter((node) => node !== data.base);
    this.nodes.selectAll("circle").data(others).join("circle").attr("r", (node) => this.size[node])
      .attr("cx", (node) => this.at[node][0]).attr("cy", (node) => this.at[node][1]);
    const half = this.size[data.base];
    this.nodes.append("rect").datum(data.base).attr("class", "base")
      .attr("x", this.at[data.base][0] - half).attr("y", this.at[data.base][1] - half)
      .attr("width", 2 * half).attr("height", 2 * half);
    this.marked = this.nodes.selectAll("circle, rect").nodes();
  }

  /** Names where there is room for them, those of much reward first. */
  drawNames() {
    const pen = document.createElement("canvas").getContext("2d");
    pen.font = "11px sans-serif";
    const taken = this.at.map((at, node) => box(at, this.size[node], this.size[node]));
    const found = [];
    const order = d3.sort(d3.range(taken.length), (node) => (node === data.base ? -Infinity : -data.rewards[node]));
    for (const node of order) {
      const text = shortened(data.names[node], 18);
      const [half, away, [x, y]] = [pen.measureText(text).width / 2 + 2, this.size[node] + 2, this.at[node]];
      const around = [[x + away + half, y], [x - away - half, y], [x, y - away - 7], [x, y + away + 7]];
      const free = around.map((at) => ({ text, at, box: box(at, half, 7) })).find((name) =>
        name.box[0] > 0 && name.box[2] < this.width
        && !taken.some((other, i) => i !== node && overlap(name.box, other)));
      if (!free) continue;
      taken.push(free.box);
      found.push(free);
    }
    this.named = found;
    this.names.selectAll("text").data(found).join("text").attr("text-anchor", "middle").attr("dy", "0.35em")
      .attr("x", (name) => name.at[0]).attr("y", (name) => name.at[1]).text((name) => name.text);
  }

  show(plan, robot = null) {
    const trails = trailsOf(plan);
    const reach = reachOf(plan);
    for (const mark of this.marked) {
      const code = reach.get(mark.__data__) ?? 0;
      if (mark.code === code) continue; // few nodes change from one plan to the next
      mark.code = code;
      mark.style.setProperty("--reached", `${100 * share(code)}%`);
      mark.classList.toggle("unreached", code === 0);
    }
    const styles = stylesOf(plan);
    this.ways = this.layOut(trails).map((hops, i) => ({ label: i, hops, ...styles[i] }));
    this.ways = this.ways.filter((way) => way.hops.length);
    const faint = (way) => robot !== null && way.label !== robot;
    const wide = this.small ? 1.3 : Math.min(Math.max(this.lane * 0.75, 2), 2.4);
    this.trails.selectAll("path.trail").data(this.ways).join("path").attr("class", "trail")
      .attr("d", (way) => line(way.hops.flat())).attr("stroke-width", wide)
      .attr("stroke-dasharray", (way) => way.dash)
      .style("stroke", (way) => way.colour).classed("faint", faint);
    this.trails.selectAll("path.heads").data(this.ways).join("path").attr("class", "heads")
      .attr("d", (way) => way.hops.map((hop) => arrowHead(hop, 1.6 * wide + 2)).join(""))
      .style("fill", (way) => way.colour).classed("faint", faint);
    if (!this.small) this.showBadges(this.ways, faint);
    const said = trails.map((trail, i) =>
      `robot ${i} ${trail.length > 1 ? `visits ${new Set(trail).size - 1} nodes` : "stays at base"}`);
    this.svg.attr("aria-label", `Map of ${title(plan)}: ${said.join(", ")}.`);
  }

  /** The hops of each robot as pairs of points; robots on the same arc go side by side. */
  layOut(trails) {
    const lanes = new Map();
    this.used = new Map();
    return trails.map((trail) => d3.pairs(trail, (tail, head) => {
      const arc = tail * this.at.length + head;
      const lane = lanes.get(arc) ?? 0;
      lanes.set(arc, lane + 1);
      const tie = Math.min(tail, head) * this.at.length + Math.max(tail, head);
      this.used.set(tie, (this.used.get(tie) ?? 0) + 1);
      return Object.assign(this.hop(tail, head, (0.6 + lane) * this.lane), { tie });
    }));
  }

  /** A number on each trail: on a long arc that few use, where it covers no name and no other number. */
  showBadges(drawn, faint) {
    const taken = [];
    const badges = drawn.map((way) => {
      const middles = way.hops.map(({ tie, 0: from, 1: to }) => {
        const at = [(from[0] + to[0]) / 2, (from[1] + to[1]) / 2];
        const own = box(at, 9, 9);
        const covered = d3.sum([...taken, this.at[data.base]], (other) => apart(other, at) < 17)
          + d3.sum(this.named, (name) => overlap(name.box, own));
        return { at, good: apart(from, to) - 10_000 * covered - 100 * this.used.get(tie) };
      });
      const { at } = d3.greatest(middles, (middle) => middle.good);
      taken.push(at);
      return { ...way, at };
    });
    markers(this.badges, badges, (way) => `translate(${way.at})`).classed("faint", faint);
  }

  /** Move the robots along their trails; gives a function that stops them. */
  animate(say, ended) {
    const longest = d3.max(this.ways, (way) => way.hops.length);
    const still = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
    const pace = still ? 900 : Math.min(Math.max(HOPS_LAST / longest, 60), 650);
    const timer = d3.timer((elapsed) => {
      const time = still ? Math.floor(elapsed / pace) : elapsed / pace;
      if (time > longest) return stop();
      say(`arc ${Math.min(Math.floor(time) + 1, longest)} of ${longest}`);
      return markers(this.robots, this.ways, ({ hops }) => {
        const [from, to] = hops[Math.min(Math.floor(time), hops.length - 1)];
        const part = still || time >= hops.length ? 1 : time % 1;
        return `translate(${from[0] + part * (to[0] - from[0])},${from[1] + part * (to[1] - from[1])})`;
      });
    });
    const stop = () => {
      timer.stop();
      this.robots.selectAll("*").remove();
      ended();
    };
    return stop;
  }

  nearest(event) {
    const at = d3.pointer(event, this.svg.node());
    const node = d3.leastIndex(this.at, (place) => apart(place, at));
    return apart(this.at[node], at) < 20 ? node : null;
  }
}

/** Circles with a number or a letter: robots in their colours, and pins. */
function markers(layer, labelled, transform) {
  const groups = layer.selectAll("g").data(labelled).join((enter) => {
    const added = enter.append("g");
    added.append("circle").attr("r", 7.5);
    added.append("text").attr("text-anchor", "middle").attr("dy", "0.35em");
    return added;
  });
  groups.attr("transform", transform);
  groups.select("circle").style("stroke", (one) => one.colour);
  groups.select("text").text((one) => one.label);
  return groups;
}

const line = (points) => `M${points.map(([x, y]) => `${x.toFixed(1)},${y.toFixed(1)}`).join("L")}`;
const apart = ([a, b], [c, d]) => Math.hypot(a - c, b - d);
const box = ([x, y], half, high) => [x - half, y - high, x + half, y + high];
const overlap = (a, b) => a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];

/** A triangle on the way, beyond its middle; none where it would be larger than the way. */
function arrowHead([from, to], size) {
  const length = apart(from, to);
  if (length < 2 * size) return "";
  const [dx, dy] = [0, 1].map((axis) => (size * (to[axis] - from[axis])) / length);
  const [x, y] = [0, 1].map((axis) => 0.38 * from[axis] + 0.62 * to[axis]);
  const [a, b] = [x - 0.6 * dx, y - 0.6 * dy];
  return `${line([[x + dx, y + dy], [a - 0.6 * dy, b + 0.6 * dx], [a + 0.6 * dy, b - 0.6 * dx]])}Z`;
}
