// A plan and the view as files, as botohe_moo.decide writes them.

const WRITERS = { json: planJson, csv: planCsv, geojson: planGeojson, svg: viewSvg };
const INLINED = ["fill", "fill-opacity", "stroke", "stroke-width", "stroke-opacity", "stroke-dasharray",
  "stroke-linejoin", "opacity", "font-size", "font-family", "font-weight", "text-anchor", "paint-order",
  "vector-effect"];

const labelsOf = (trail) => trail.map((node) => data.labels[node]);
const positionOf = (node) => (data.pos ?? data.places)[node];

/** Why the plan cannot be written in a format; empty if it can. */
function missing(plan, kind) {
  if (data.labels === null && kind !== "svg") return "The labels of this mission's nodes cannot be written to files.";
  const bare = kind === "geojson" ? trailsOf(plan).flat().find((node) => positionOf(node) === null) : undefined;
  return bare === undefined ? "" : `GeoJSON needs positions: node ${isolated(data.names[bare])} has none.`;
}

function planJson(plan) {
  const [reward, survivors] = data.objectives[plan];
  const content = {
    mission: data.name, robots: data.robots, reward, survivors,
    robot_survival: data.plans[plan].map((trail) => data.trail_survival[trail]),
    trail_lengths: data.plans[plan].map((trail) => data.trail_lengths[trail]),
    ...(data.kinds.length ? { robot_kinds: data.kind_of.map((kind) => data.kinds[kind]) } : {}),
    ...(data.collected.length ? { robot_rewards: data.plans[plan].map((trail) => data.trail_rewards[trail]) } : {}),
    trails: trailsOf(plan).map(labelsOf),
  };
  return `${JSON.stringify(content, null, 1)}\n`;
}

function planCsv(plan) {
  const quoted = (text) => (/[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  const name = (label) => (typeof label === "string" ? label : JSON.stringify(label));
  const kind = (robot) => (data.kinds.length ? [quoted(kindOf(robot))] : []);
  const rows = trailsOf(plan).flatMap((trail, robot) =>
    trail.map((node, step) =>
      [robot, step, quoted(name(data.labels[node])), ...(positionOf(node) ?? ["", ""]),
        ...kind(robot)].join(",")));
  return [`robot,step,node,x,y${data.kinds.length ? ",kind" : ""}`, ...rows, ""].join("\r\n");
}

/** As from Python, but probabilities to be reached have six decimals. */
function planGeojson(plan) {
  const feature = (type, coordinates, properties) =>
    ({ type: "Feature", geometry: { type, coordinates }, properties });
  const lines = trailsOf(plan).map((trail, robot) => {
    const way = trail.map(positionOf);
    const number = data.plans[plan][robot];
    const properties = { robot, survival: data.trail_survival[number], nodes: labelsOf(trail),
      ...(data.kinds.length ? { kind: kindOf(robot) } : {}),
      ...(data.collected.length
        ? { length: data.trail_lengths[number], reward: data.trail_rewards[number] } : {}) };
    return way.length > 1 ? feature("LineString", way, properties) : feature("Point", way[0], properties);
  });
  const points = [...reachOf(plan, "reached_values")].map(([node, reached]) => feature("Point", positionOf(node),
    { node: data.labels[node], reward: data.rewards[node], reached,
      ...(data.collected.length ? { collected: reachOf(plan, "collected_values").get(node) } : {}) }));
  return `${JSON.stringify({ type: "FeatureCollection", features: [...lines, ...points] }, null, 1)}\n`;
}

/** Front and map side by side, in the colours of the screen. */
function viewSvg() {
  const both = ["front", "map"].map(byId);
  const [front, map] = both.map((svg) => svg.viewBox.baseVal);
  const [wide, high] = [front.width + map.width + 24, Math.max(front.height, map.height) + 34];
  const view = d3.create("svg:svg").attr("xmlns", "http://www.w3.org/2000/svg").attr("width", wide).attr("height", high)
    .attr("viewBox", `0 0 ${wide} ${high}`);
  const style = getComputedStyle(document.body);
  view.append("rect").attr("width", wide).attr("height", high).attr("fill", plain(style.backgroundColor));
  view.append("text").attr("x", 12).attr("y", 21).attr("font-size", 15).attr("font-family", "sans-serif")
    .attr("fill", plain(style.color))
    .text(`${isolated(document.querySelector("h1").textContent)}: ${byId("at-hand").firstChild.textContent}`);
  both.forEach((svg, i) => {
    const { width, height } = svg.viewBox.baseVal;
    const part = view.append("svg").attr("x", i * (front.width + 24)).attr("y", 34).attr("width", width)
      .attr("height", height); // which cuts a map behind the graph off
    if (i && byId("ground").width > 0 && data.arcs[0].length > MANY) {
      part.append("image").attr("href", byId("ground").toDataURL()).attr("width", map.width).attr("height", map.height);
    }
    for (const layer of svg.children) part.node().append(inlined(layer));
  });
  return new XMLSerializer().serializeToString(view.node());
}

/** A copy that looks the same without the page's styles. */
function inlined(element) {
  const copy = element.cloneNode(false);
  copy.removeAttribute("style");
  const style = getComputedStyle(element);
  for (const name of INLINED) copy.setAttribute(name, plain(style.getPropertyValue(name)));
  for (const child of element.childNodes) {
    copy.append(child.nodeType === Node.ELEMENT_NODE ? inlined(child) : child.cloneNode());
  }
  return copy;
}

/** Mixed colours as plain ones, which every program reads. */
function plain(value) {
  if (!value.startsWith("color(")) return value;
  plain.known ??= new Map();
  if (!plain.known.has(value)) {
    const pen = new OffscreenCanvas(1, 1).getContext("2d");
    pen.fillStyle = value;
    pen.fillRect(0, 0, 1, 1);
    plain.known.set(value, `rgb(${[...pen.getImageData(0, 0, 1, 1).data].slice(0, 3).join(", ")})`);
  }
  return plain.known.get(value);
}

function download(plan, kind) {
  const link = make("a", {
    href: URL.createObjectURL(new Blob([WRITERS[kind](plan)])),
    download: `${data.name.replace(/[^\p{L}\p{N}._-]+/gu, "_")}-plan-${data.ids[plan]}.${kind}`,
  });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
