// The data of the page: plans are known by their places along the front, from the least reward.

const LITTLE = 1001, NEARLY = 1002; // codes of probabilities that would round to 0 and to 1
let data = null; // set once, by main.js
let scenario = null; // the one that trails and the map are shown in; null for the mean over all

async function unpack(text) {
  const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return JSON.parse(await new Response(stream).text());
}

/** What is shown for a probability. */
function probability(code) {
  if (code === LITTLE) return "<0.001";
  return code === NEARLY ? ">0.999" : (code / 1000).toFixed(3);
}

/** The code of a probability. */
function codeOf(value) {
  const code = Math.round(1000 * value);
  if (code === 0 && value > 0) return LITTLE;
  return code === 1000 && value < 1 - 1e-7 ? NEARLY : code;
}

/** A number in [0, 1] to draw by. */
function share(code) {
  if (code === LITTLE) return 0.0005;
  return code === NEARLY ? 0.9995 : code / 1000;
}

const trailsOf = (plan) => data.plans[plan].map((trail) => data.trails[trail]);
const ascending = (a, b) => a - b;
const kindOf = (robot) => data.kinds[data.kind_of[robot]]; // undefined where all robots are of one kind
const robotName = (robot) => (data.kinds.length ? `${kindOf(robot)} ${robot}` : String(robot));
const robotText = (robot) => (data.kinds.length ? robotName(robot) : `robot ${robot}`);
/** A length with as many decimals as those of trails. */
const lengthOf = (value) => value.toFixed(data.trail_length_texts[0].split(".")[1]?.length ?? 0);
const whereStays = (trail) => (trail[0] === data.base ? "base" : isolated(data.names[trail[0]]));

/** How likely an arc is survived by the kind that it is safest for. */
const arcCodes = () => (scenario === null ? data.arcs[2]
  : data.arcs[0].map((_, arc) => codeOf(d3.max(data.arc_survival[scenario], (kind) => kind[arc]))));

/** How far a robot has come at each node of its trail, and how likely it is alive there. */
function journeyOf(plan, robot) {
  const [tails, heads] = data.arcs;
  const key = (tail, head) => tail * data.names.length + head;
  journeyOf.arcs ??= new Map(tails.map((tail, arc) => [key(tail, heads[arc]), arc]));
  const kind = data.kind_of[robot] ?? 0;
  const alive = data.scenarios.map(([, chance], i) => (scenario === null ? chance : Number(i === scenario)));
  let length = 0;
  return trailsOf(plan)[robot].map((node, i, trail) => {
    if (i > 0) {
      const arc = journeyOf.arcs.get(key(trail[i - 1], node));
      length += data.arc_lengths[arc];
      alive.forEach((_, i) => { alive[i] *= data.arc_survival[i][kind][arc]; });
    }
    return { node, length, survival: d3.sum(alive), isFirst: trail.indexOf(node) === i };
  });
}

/** Codes of a probability of the nodes on the plan's trails, such as to be reached, or its values to six decimals. */
function reachOf(plan, as = "reached") {
  const known = (reachOf[as] ??= new Map());
  if (!known.has(plan)) {
    const nodes = [...new Set(trailsOf(plan).flat())].sort(ascending);
    known.set(plan, new Map(nodes.map((node, i) => [node, data[as][plan][i]])));
  }
  return known.get(plan);
}

/** How likely a robot survives its trail. */
const survivalCode = (plan, robot) => (scenario === null ? data.trail_codes[data.plans[plan][robot]]
  : codeOf(journeyOf(plan, robot).at(-1).survival));

/** Codes of the probabilities that nodes are reached, in the scenario that is shown. */
function reachShown(plan) {
  if (scenario === null) return reachOf(plan);
  const lost = new Map();
  trailsOf(plan).forEach((_, robot) => journeyOf(plan, robot).filter((visit) => visit.isFirst)
    .forEach(({ node, survival }) => lost.set(node, (lost.get(node) ?? 1) * (1 - survival))));
  return new Map([...lost].map(([node, all]) => [node, codeOf(1 - all)]));
}

const reachCode = (plan, node) => reachOf(plan).get(node) ?? 0;
const title = (plan) => `Plan ${data.ids[plan]}`;
const marksOf = (plan) => data.marks.filter((mark) => mark.plan === plan);
const rewardOf = (plan) => data.objective_texts[0][plan];
const survivorsOf = (plan) => data.objective_texts[1][plan];

/** Make an element; texts become text, never markup. */
function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value !== null) element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

const rowHead = (content) => make("th", { scope: "row" }, content);
const columnHead = (content, number = true) => make("th", { scope: "col", class: number ? "number" : null }, content);

/**
 * Fill a table from its columns: the name, whether it holds numbers, and what makes the cell of a row.
 * The first column heads the rows; columns that are false are left out.
 */
function fillTable(id, columns, rows, attributes = () => ({})) {
  const shown = columns.filter(Boolean);
  const head = make("tr", {}, ...shown.map(([name, number]) => columnHead(name, number)));
  const body = rows.map((row, i) => make("tr", attributes(row), ...shown.map(([, , cellOf]) => cellOf(row, i))));
  byId(id).replaceChildren(make("thead", {}, head), make("tbody", {}, ...body));
}

/** A text of at most so many letters; a longer one ends in an ellipsis. */
function shortened(text, most) {
  const letters = [...text];
  return letters.length > most ? `${letters.slice(0, most - 1).join("")}…` : text;
}

/** A name within a text, whatever direction it is written in. */
const isolated = (name) => (/[\u0590-\u{10ffff}]/u.test(name) ? `\u2068${name}\u2069` : name);

/** The name of a node, apart from the direction of the text around it. */
const nodeName = (node) => make("bdi", {}, data.names[node]);
const byId = (id) => document.getElementById(id);

/** Switch a control on or off; not by `disabled`, which takes the focus away. Only fields heed `readOnly`. */
function enable(control, on) {
  control.setAttribute("aria-disabled", !on);
  control.readOnly = !on;
}
