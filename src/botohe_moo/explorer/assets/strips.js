// A strip for each robot that leaves: how likely it is alive along its trail, and which nodes it visits.

const STRIP = { left: 26, right: 30, top: 50, low: 132, height: 152 }; // pixels
const NAMES_APART = 13; // pixels along a strip
const upward = d3.scaleLinear([0, 1], [STRIP.low, STRIP.top]); // where a probability to be alive is
const TURN = -52; // degrees of the names

function showStrips(plan) {
  const [trails, wide] = [trailsOf(plan), showStrips.width];
  const styles = stylesOf(trails);
  const robots = d3.range(data.robots).filter((robot) => trails[robot].length > 1);
  const strips = robots.map((robot) => ({ robot, style: styles[robot], trail: trails[robot],
    number: data.plans[plan][robot], journey: journeyOf(plan, robot) }));
  const longest = d3.max(strips, ({ journey }) => journey.at(-1).length);
  const x = d3.scaleLinear([0, longest], [STRIP.left, wide - STRIP.right]);
  const axis = d3.axisBottom(x).ticks(wide / 90).tickSizeOuter(0);
  d3.select(byId("strips")).selectAll("figure").data(strips).join(addStrip).style("--robot", ({ style }) => style.colour)
    .each(function draw(strip) {
      const key = [strip.robot, strip.number, strip.style.colour, strip.style.dash, longest, scenario].join();
      if (this.key !== key) drawStrip(this, strip, survivalCode(plan, strip.robot), x, axis); // neighbours share trails
      this.key = key;
    });
}

function addStrip(enter) {
  const added = enter.append("figure");
  added.append("figcaption");
  const svg = added.append("svg").attr("role", "img").attr("viewBox", `0 0 ${showStrips.width} ${STRIP.height}`);
  for (const name of ["axes across", "axes up", "shape", "labels"]) svg.append("g").attr("class", name);
  svg.select(".across").attr("transform", `translate(0,${STRIP.low})`);
  svg.select(".up").attr("transform", `translate(${STRIP.left},0)`).call(d3.axisLeft(upward).tickValues([0, 0.5, 1])
    .tickFormat(String).tickPadding(6).tickSize(STRIP.left + STRIP.right - showStrips.width));
  for (const name of ["under", "stems", "alive", "visits", "visits again", "pointed"]) {
    svg.select(".shape").append("path").attr("class", name);
  }
  return added;
}

function drawStrip(element, { robot, style, trail, number, journey }, code, x, axis) {
  const [figure, start] = [d3.select(element), isolated(data.names[trail[0]])];
  const said = `survives with ${probability(code)}, length ${data.trail_length_texts[number]}`;
  const read = make("span", { class: "caption" });
  figure.select("figcaption").node().replaceChildren(
    make("span", { class: "robot" }, sampleOf(style, trail), make("strong", {}, robotText(robot))),
    `from ${start}: ${said}`, read);
  const svg = figure.select("svg[role]")
    .attr("aria-label", `Survival along the trail of ${robotText(robot)} from ${start}: ${said}.`);
  svg.select(".across").call(axis);
  const points = journey.map((visit) => [x(visit.length), upward(visit.survival)]);
  const named = [];
  points.forEach(([at], i) => { if (at - (points[named.at(-1)]?.[0] ?? -Infinity) >= NAMES_APART) named.push(i); });
  svg.select(".under").attr("d", `${line(points)}V${STRIP.low}H${STRIP.left}Z`);
  svg.select(".alive").attr("d", line(points)).attr("stroke-dasharray", style.dash);
  svg.select(".stems").attr("d", named.map((i) => `M${points[i]}V${STRIP.top - 4}`).join(""));
  const size = Math.min(Math.max(showStrips.width / journey.length / 5, 1.2), 2.7);
  const dots = (isFirst) => points.filter((_, i) => journey[i].isFirst === isFirst).map((at) => disc(at, size)).join("");
  svg.select(".visits").attr("d", dots(true));
  svg.select(".again").attr("d", dots(false));
  svg.select(".labels").selectAll("text").data(named).join("text")
    .attr("transform", (i) => `translate(${points[i][0] + 3},${STRIP.top - 6}) rotate(${TURN})`)
    .text((i) => shortened(data.names[journey[i].node], 9));
  const point = (i) => {
    svg.select(".pointed").attr("d", i === null ? null : disc(points[i], 5));
    read.replaceChildren(...(i === null ? [] : [nodeName(journey[i].node),
      `: alive with ${probability(codeOf(journey[i].survival))} after ${lengthOf(journey[i].length)}`]));
    tellNode(i === null ? null : journey[i].node);
  };
  svg.on("pointermove", (event) => point(d3.leastIndex(points, ([at]) => Math.abs(at - d3.pointer(event)[0]))))
    .on("pointerleave", () => point(null));
}
