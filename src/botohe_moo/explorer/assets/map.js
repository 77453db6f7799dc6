// The map of the site with the trails of one plan on it; small for pinned plans.

const DASHES = ["", "12 4", "5 3", "12 3 3 3", "3 2"];
const MANY = 1500; // arcs from which the ground is drawn on a canvas
const SHADES = 6; // of arcs, by danger
const DARKEST = 0.5; // opacity of the band of the most dangerous arcs
const MOST_PIXELS = 16e6; // of the canvas, which browsers limit
const ROUND = 15; // the diameter of what a number or a letter is in
const TRIANGLE = "M0,-1L1,1H-1Z", TURNS = [0, 180, 270, 90]; // of kinds, since several may start at one node
const HOPS_LAST = 12_000; // milliseconds that an animation takes at most

const colourOf = (kind) => `var(--robot-${kind % 10})`;

/**
 * Colour and dash of each robot by their trails; those that leave the base come first.
 * If there are several kinds, each has a colour, and its robots differ in dash.
 */
function stylesOf(trails) {
  let leaving = 0;
  return trails.map((trail, robot) => {
    if (data.kinds.length) {
      const dash = robot - data.kind_of.indexOf(data.kind_of[robot]);
      return { colour: colourOf(data.kind_of[robot]), dash: DASHES[dash % DASHES.length] || null };
    }
    const style = trail.length > 1 ? leaving++ : 0;
    const dash = DASHES[(style + Math.floor(style / 10)) % DASHES.length] || null;
    return { colour: `var(--robot-${style % 10})`, dash };
  });
}

/** A piece of the line of a robot's trail; nothing of one that stays. */
function sampleOf({ colour, dash }, trail) {
  const svg = d3.create("svg").attr("class", "sample").attr("viewBox", "0 0 34 8").attr("aria-hidden", "true");
  svg.append("path").attr("d", trail.length > 1 ? "M0,4H34" : "M0,0").style("stroke", colour)
    .attr("stroke-dasharray", dash);
  return svg.node();
}

const isStill = () => window.matchMedia("(prefers-reduced-motion: reduce)").matches;

/** Milliseconds of a hop, of so many that follow each other. */
const paceOf = (hops) => (isStill() ? 900 : Math.min(Math.max(HOPS_LAST / hops, 60), 650));

class SiteMap {
  constructor(svg, canvas = null) {
    this.svg = d3.select(svg);
    this.canvas = canvas;
    for (const layer of ["floor", "shades", "arcs", "ends", "trails", "rings", "nodes", "spot", "names", "badges",
      "robots"]) this[layer] = this.svg.append("g").attr("class", layer);
  }

  resize(width, small = false) {
    const [xs, ys] = [0, 1].map((axis) => d3.extent(data.places, (place) => place[axis]));
    const [wide, high] = [xs[1] - xs[0], ys[1] - ys[0]];
    const margin = small ? 10 : 30;
    const height = width * Math.min(Math.max(high / (wide || high || 1), 0.35), 1.05);
    const scale = wide + high
      ? Math.min((width - 2 * margin) / (wide || 1e-9), (height - 2 * margin) / (high || 1e-9)) : 0;
    const place = ([x, y]) => [
      width / 2 + scale * (x - (xs[0] + xs[1]) / 2),
      height / 2 - scale * (y - (ys[0] + ys[1]) / 2), // y points up on a map
    ];
    this.at = data.places.map(place);
    Object.assign(this, { width, height, small });
    this.svg.attr("viewBox", `0 0 ${width} ${height}`);
    const radius = this.nodeRadius();
    const most = d3.max(data.rewards) || 1;
    this.size = data.rewards.map((reward, node) =>
      node === data.base ? Math.max(1.1 * radius, this.small ? 3 : 5.5)
        : radius * (0.5 + 0.7 * Math.sqrt(reward / most)));
    this.lane = Math.min(Math.max(0.42 * radius, 1.3), 3.4);
    this.band = 4.8 * this.lane; // wider than trails in both directions
    this.drawFloor(place);
    this.drawGround();
    this.drawKinds();
    this.drawNodes();
    if (!small) this.measureNames();
  }

  /** The map of the site behind the graph. */
  drawFloor(place) {
    if (!data.background) return;
    const { href, extent: [left, right, low, high] } = data.background;
    const [[x, y], [far, down]] = [place([left, high]), place([right, low])];
    this.floor.selectAll("image").data([href]).join("image").attr("href", String).attr("preserveAspectRatio", "none")
      .attr("x", x).attr("y", y).attr("width", far - x).attr("height", down - y);
  }

  /** Nodes are as large as the narrower places allow. */
  nodeRadius() {
    const [least, most] = this.small ? [1.2, 4.5] : [2.2, 10];
    if (this.at.length < 2) return most;
    const tree = d3.Delaunay.from(this.at);
    const nearest = this.at.map((one, i) => d3.min(tree.neighbors(i), (j) => apart(one, this.at[j])) ?? 99);
    return Math.min(Math.max(0.34 * d3.quantile(nearest, 0.2), least), most);
  }

  /** All arcs, on bands that are the darker the more dangerous; both directions share one if they are the same. */
  drawGround() {
    const [[tails, heads], codes] = [data.arcs, arcCodes()];
    const danger = new Map(tails.map((tail, i) => [`${tail} ${heads[i]}`, 1 - share(codes[i])]));
    const most = d3.max(danger.values()) || 1;
    const [lines, bands] = [[], Array.from({ length: 2 * SHADES }, () => [])];
    tails.forEach((tail, i) => {
      const [head, own] = [heads[i], danger.get(`${tail} ${heads[i]}`)];
      const same = own === danger.get(`${head} ${tail}`);
      if (same && tail > head) return;
      const way = this.hop(tail, head, same ? 0 : this.band / 4);
      const isOneWay = !danger.has(`${head} ${tail}`);
      lines.push(line(way) + (isOneWay ? arrowHead(way, this.small ? 3 : 5) : ""));
      bands[Math.min(Math.floor((SHADES * own) / most), SHADES - 1) + (same ? 0 : SHADES)].push(line(way));
    });
    const drawn = bands.map((ways, i) => ({ d: ways.join(""), opacity: (DARKEST * (i % SHADES)) / (SHADES - 1),
      wide: i < SHADES ? this.band : this.band / 2 }));
    drawn.push({ d: lines.join(""), opacity: 0.6, wide: this.small ? 0.5 : 0.9 });
    if (this.canvas === null || tails.length <= MANY) {
      this.arcs.selectAll("path").data(drawn).join("path").attr("d", (one) => one.d)
        .attr("stroke-opacity", (one) => one.opacity).attr("stroke-width", (one) => one.wide);
      return;
    }
    const dots = Math.min(window.devicePixelRatio || 1, Math.sqrt(MOST_PIXELS / (this.width * this.height)));
    this.canvas.width = this.width * dots;
    this.canvas.height = this.height * dots;
    const pen = this.canvas.getContext("2d");
    pen.scale(dots, dots);
    pen.strokeStyle = getComputedStyle(this.canvas).getPropertyValue("--arc");
    for (const { d, opacity, wide } of drawn) {
      Object.assign(pen, { globalAlpha: opacity, lineWidth: wide });
      pen.stroke(new Path2D(d));
    }
  }

  /** What only some kinds can take or collect in their colours, where they start and end, and what pays on return. */
  drawKinds() {
    const shades = data.only.flatMap(([kinds, arcs, nodes]) => kinds.map((kind, i) => {
      const wide = 1.5 * this.band / kinds.length; // more than the band of danger
      const aside = (i - (kinds.length - 1) / 2) * wide;
      const ways = arcs.map((arc) => [data.arcs[0][arc], data.arcs[1][arc]]);
      const known = new Set(ways.map(String));
      const once = ways.filter(([tail, head]) => tail < head || !known.has(`${head},${tail}`));
      const bands = once.map(([tail, head]) => line(this.hop(tail, head, aside)));
      const spots = nodes.map((node) => disc(this.at[node], this.size[node] + 2.2 * this.lane * (1 - i / kinds.length)));
      return { kind, wide, bands: bands.join(""), spots: spots.join("") };
    }));
    this.shades.selectAll("path.band").data(shades).join("path").attr("class", "band").attr("d", (shade) => shade.bands)
      .attr("stroke-width", (shade) => shade.wide).style("stroke", (shade) => colourOf(shade.kind));
    this.shades.selectAll("path.spot").data(shades).join("path").attr("class", "spot").attr("d", (shade) => shade.spots)
      .style("fill", (shade) => colourOf(shade.kind));
    const ends = data.ends.flatMap(([start, end], kind) =>
      (start === end ? [{ node: start, kind }] : [{ node: end, kind, hollow: true }, { node: start, kind }]));
    this.ends.selectAll("path").data(ends).join("path").attr("d", TRIANGLE).classed("hollow", (one) => one.hollow)
      .style("--kind", (one) => colourOf(one.kind)).attr("transform", ({ node, kind }) =>
        `translate(${this.at[node]}) rotate(${TURNS[kind % 4]}) scale(${1.7 * this.size[node] + (this.small ? 1 : 2)})`);
    this.rings.selectAll("circle").data(data.rings).join("circle").attr("cx", (node) => this.at[node][0])
      .attr("cy", (node) => this.at[node][1]).attr("r", (node) => this.size[node] + (this.small ? 1.5 : 3));
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
    const others = d3.range(this.at.length).filter((node) => node !== data.base && !data.depots.includes(node));
    this.nodes.selectAll("circle").data(others).join("circle").attr("r", (node) => this.size[node])
      .attr("cx", (node) => this.at[node][0]).attr("cy", (node) => this.at[node][1]);
    for (const node of [...data.depots, data.base]) {
      const half = this.size[node];
      this.nodes.append("rect").datum(node).attr("class", node === data.base ? "base" : "depot")
        .classed("bold", node === data.base && data.depots.length > 0)
        .attr("x", this.at[node][0] - half).attr("y", this.at[node][1] - half)
        .attr("width", 2 * half).attr("height", 2 * half);
    }
    this.marked = this.nodes.selectAll("circle, rect").nodes();
  }

  /** Where names may be, the places preferred first, and which room nodes and arcs take. */
  measureNames() {
    const pen = document.createElement("canvas").getContext("2d");
    pen.font = "11px sans-serif";
    this.names.selectAll("*").remove();
    this.texts = data.names.map((name) => shortened(name, 18));
    const marked = new Map([...data.rings.map((node) => [node, 3]), ...data.ends.flat().map((node) => [node, 5])]);
    const sizes = this.size.map((size, node) => size + (marked.get(node) ?? 0));
    const [columns, rows] = [this.width, this.height].map((pixels) => Math.floor(pixels / CELL));
    this.places = this.at.map(([x, y], node) => {
      const [half, away] = [pen.measureText(this.texts[node]).width / 2 + 2, sizes[node] + 2];
      const [side, above, beside, over] = [away + half, away + 6, 0.6 * away + half, 0.6 * away + 6];
      return [[side, 0], [-side, 0], [0, -above], [0, above],
        [beside, -over], [beside, over], [-beside, -over], [-beside, over],
        [half, -above], [half, above], [-half, -above], [-half, above]]
        .map(([right, down]) => ({ node, at: [x + right, y + down], part: inCells(box([x + right, y + down], half, 6)) }))
        .filter(({ part }) => part[0] >= 0 && part[1] >= 0 && part[2] <= columns && part[3] <= rows);
    });
    this.order = d3.sort(d3.range(this.at.length), (node) => (node === data.base ? -Infinity : -data.rewards[node]));
    this.room = new Room(columns, new Uint16Array(columns * rows));
    data.arcs[0].forEach((tail, i) => this.room.trace(this.at[tail], this.at[data.arcs[1][i]], BESIDE));
    this.at.forEach((at, node) => this.room.take(inCells(box(at, sizes[node], sizes[node]))));
  }

  /** Names where there is room, those of much reward first, and beside trails and arcs as far as possible. */
  drawNames() {
    const room = this.filled = new Room(this.room.columns, this.room.cells.slice());
    for (const { hops } of this.ways) for (const [from, to] of hops) room.trace(from, to, CROSSED);
    this.named = [];
    for (const node of this.order) {
      let [best, least] = [null, TAKEN];
      for (const place of this.places[node]) { // the first of those that cost least
        const cost = room.cost(place.part, least);
        if (cost < least) [best, least] = [place, cost];
        if (least === 0) break;
      }
      if (best === null) continue;
      room.take(best.part);
      this.named.push(best);
    }
    this.names.selectAll("text").data(this.named, (name) => name.node).join((enter) => enter.append("text")
      .attr("text-anchor", "middle").attr("dy", "0.35em").text((name) => this.texts[name.node]))
      .filter(function isElsewhere(name) { return this.place !== name; }) // few, and each costs
      .property("place", (name) => name).attr("transform", (name) => `translate(${name.at})`);
  }

  show(plan, robot = null) {
    const trails = trailsOf(plan);
    const styles = stylesOf(trails);
    const faint = (way) => robot !== null && way.robot !== robot;
    this.fillNodes(reachShown(plan));
    this.drawWays(trails.map((trail, i) => ({ robot: i, trail, journey: journeyOf(plan, i),
      label: this.width < 480 ? String(i) : robotName(i), look: faint({ robot: i }) ? "faint" : "", ...styles[i] })));
    if (!this.small) this.showBadges(this.ways, faint);
    const said = trails.map((trail, i) =>
      `${robotText(i)} ${trail.length > 1 ? `visits ${new Set(trail).size - 1} nodes` : `stays at ${whereStays(trail)}`}`);
    this.svg.attr("aria-label", `Map of ${title(plan)}: ${said.join(", ")}.`);
  }

  /** Fill nodes by codes in [0, 1]. */
  fillNodes(codes) {
    for (const mark of this.marked) {
      const code = codes.get(mark.__data__) ?? 0;
      if (mark.code === code) continue; // few nodes change from one plan to the next
      mark.code = code;
      mark.style.setProperty("--reached", `${100 * share(code)}%`);
      mark.classList.toggle("unreached", code === 0);
    }
  }

  /** Draw trails, or parts of them, each with a colour, a dash, and a class for its look. */
  drawWays(ways) {
    const hops = this.layOut(ways.map((way) => way.trail));
    this.ways = ways.map((way, i) => ({ ...way, hops: hops[i] })).filter((way) => way.hops.length);
    const wide = this.small ? 1.3 : Math.min(Math.max(this.lane * 0.75, 2), 2.4);
    const edged = data.arcs[0].length > MANY ? [] : this.ways; // which takes long where trails are long
    this.trails.selectAll("path.edge").data(edged).join("path").attr("class", (way) => `edge ${way.look}`)
      .attr("d", (way) => line(way.hops.flat())).attr("stroke-width", wide + (this.small ? 1 : 1.8))
      .attr("stroke-dasharray", (way) => way.dash);
    this.trails.selectAll("path.trail").data(this.ways).join("path").attr("class", (way) => `trail ${way.look}`)
      .attr("d", (way) => line(way.hops.flat())).attr("stroke-width", wide)
      .attr("stroke-dasharray", (way) => way.dash).style("stroke", (way) => way.colour);
    this.trails.selectAll("path.heads").data(this.ways).join("path").attr("class", (way) => `heads ${way.look}`)
      .attr("d", (way) => way.hops.map((hop) => arrowHead(hop, 1.6 * wide + 2)).join(""))
      .style("fill", (way) => way.colour);
    if (!this.small) this.drawNames();
  }

  /** Show where a node is. */
  point(node) {
    this.spot.selectAll("circle").data(node === null ? [] : [node]).join("circle").attr("r", (one) => this.size[one] + 6)
      .attr("cx", (one) => this.at[one][0]).attr("cy", (one) => this.at[one][1]);
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

  /** A number on each trail: on a long arc that few use, where it covers no name, node or other number. */
  showBadges(drawn, faint) {
    const taken = [];
    const badges = drawn.map((way) => {
      const middles = way.hops.map(({ tie, 0: from, 1: to }) => {
        const at = [(from[0] + to[0]) / 2, (from[1] + to[1]) / 2];
        const own = box(at, labelWidth(way.label) / 2 + 1.5, 9);
        const flat = ([x, y]) => [x * ROUND / labelWidth(way.label), y];
        const covered = d3.sum([...taken, this.at[data.base]], (other) => apart(flat(other), flat(at)) < 17)
          + (this.filled.cost(inCells(own), TAKEN) >= TAKEN);
        return { at, good: apart(from, to) - 10_000 * covered - 100 * this.used.get(tie) };
      });
      const { at } = d3.greatest(middles, (middle) => middle.good);
      taken.push(at);
      return { ...way, at };
    });
    markers(this.badges, badges, (way) => `translate(${way.at})`).classed("faint", faint);
  }

  /** Draw each robot where it is when it has come so far, or at the node before that. */
  drawRobots(gone, atNodes) {
    markers(this.robots, this.ways, ({ hops, journey }) => {
      const i = d3.bisector((visit) => visit.length).right(journey, gone) - 1;
      if (i >= hops.length) return `translate(${hops.at(-1)[1]})`;
      const part = atNodes ? 0 : (gone - journey[i].length) / (journey[i + 1].length - journey[i].length);
      const [[x, y], [a, b]] = hops[i];
      return `translate(${x + part * (a - x)},${y + part * (b - y)})`;
    });
  }

  /** The arc that the pointer is on, as the places of its nodes. */
  nearestArc(event) {
    const at = d3.pointer(event, this.svg.node());
    const [tails, heads] = data.arcs;
    const away = (arc) => fromLine(at, this.at[tails[arc]], this.at[heads[arc]]);
    const arc = d3.least(d3.range(tails.length), away);
    return arc !== undefined && away(arc) < 9 ? arc : null;
  }

  nearest(event) {
    const at = d3.pointer(event, this.svg.node());
    const node = d3.leastIndex(this.at, (place) => apart(place, at));
    return apart(this.at[node], at) < 20 ? node : null;
  }
}

/** Circles with a number or a letter, wider for names: robots in their colours, and pins. */
function markers(layer, labelled, transform) {
  const groups = layer.selectAll("g").data(labelled).join((enter) => {
    const added = enter.append("g");
    added.append("rect").attr("height", ROUND).attr("y", -ROUND / 2).attr("rx", ROUND / 2);
    added.append("text").attr("text-anchor", "middle").attr("dy", "0.35em");
    return added;
  });
  groups.attr("transform", transform);
  groups.select("rect").style("stroke", (one) => one.colour)
    .attr("width", (one) => labelWidth(one.label)).attr("x", (one) => -labelWidth(one.label) / 2);
  groups.select("text").text((one) => one.label);
  return groups;
}

const labelWidth = (label) => (label.length > 2 && data.kinds.length ? 6.4 * label.length + 8 : ROUND);
const disc = ([x, y], r) => `M${x - r},${y}a${r},${r} 0 1,0 ${2 * r},0a${r},${r} 0 1,0 ${-2 * r},0`;
const line = (points) => `M${points.map(([x, y]) => `${x.toFixed(1)},${y.toFixed(1)}`).join("L")}`;
const apart = ([a, b], [c, d]) => Math.hypot(a - c, b - d);
const box = ([x, y], half, high) => [x - half, y - high, x + half, y + high];
const fromLine = ([x, y], [a, b], [c, d]) => {
  const part = ((x - a) * (c - a) + (y - b) * (d - b)) / ((c - a) ** 2 + (d - b) ** 2 || 1);
  const on = Math.min(Math.max(part, 0), 1);
  return Math.hypot(x - a - on * (c - a), y - b - on * (d - b));
};

/** A triangle on the way, beyond its middle; none where it would be larger than the way. */
function arrowHead([from, to], size) {
  const length = apart(from, to);
  if (length < 2 * size) return "";
  const [dx, dy] = [0, 1].map((axis) => (size * (to[axis] - from[axis])) / length);
  const [x, y] = [0, 1].map((axis) => 0.38 * from[axis] + 0.62 * to[axis]);
  const [a, b] = [x - 0.6 * dx, y - 0.6 * dy];
  return `${line([[x + dx, y + dy], [a - 0.6 * dy, b + 0.6 * dx], [a + 0.6 * dy, b - 0.6 * dx]])}Z`;
}
