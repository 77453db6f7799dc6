// The state of the view. The address holds it; each change that Back undoes is a step of the history.

const MAX_PINS = 4, LETTERS = "ABCD";
const FILTERS = ["reward", "survivors", "node", "reach"];
const PAUSE = 700; // milliseconds: steps along the front that follow sooner are one walk
const SLACK = 1e-9; // of a quantity's range, as wishes have it

const state = { plan: 0, pins: [], robot: null, filters: {} };
let matching = []; // the plans that meet the filters

function toHash() {
  const said = new URLSearchParams({ plan: data.ids[state.plan] });
  if (state.pins.length) said.set("pins", state.pins.map((plan) => data.ids[plan]).join(","));
  if (state.robot !== null) said.set("robot", state.robot);
  if (scenario !== null) said.set("scenario", data.scenarios[scenario][0]);
  for (const name of FILTERS) if (state.filters[name] !== null) said.set(name, state.filters[name]);
  if (state.filters.node === null) said.delete("reach"); // which is the probability of a node
  return `#${said.toString().replaceAll("%2C", ",")}`;
}

/** Read the state from the address, else take it as at the start; tells what of the address was not used. */
function readHash() {
  const said = new URLSearchParams(location.hash.slice(1));
  const ids = new Map(data.ids.map((id, plan) => [String(id), plan]));
  const whole = (text, below) => (/^\d+$/.test(text ?? "") && Number(text) < below ? Number(text) : null);
  const pins = (said.get("pins") ?? "").split(",").filter((id) => ids.has(id));
  state.plan = ids.get(said.get("plan")) ?? firstPlan();
  state.pins = [...new Set(pins)].slice(0, MAX_PINS).map((id) => ids.get(id));
  state.robot = whole(said.get("robot"), data.robots);
  const place = data.scenarios.findIndex(([name]) => name === said.get("scenario"));
  scenario = place < 0 ? null : place;
  for (const name of FILTERS) state.filters[name] = filterValue(name, said.get(name));
  state.filters.node = whole(said.get("node"), data.names.length);
  if (state.filters.node === null) state.filters.reach = null;
  findMatching();
  const used = new URLSearchParams(toHash().slice(1));
  const same = (one, other) => one === other || (one !== null && Number(one) === Number(other));
  const unused = [...said].filter(([name, value]) => !same(used.get(name), value));
  const named = shortened(unused.map((part) => part.filter(Boolean).join("=")).join(", "), 60);
  return named && `The page could not use this part of its address: ${named}.`;
}

/** The answer to the first wish, else the first knee. */
const firstPlan = () => data.marks.find((mark) => ["choice", "knee"].includes(mark.kind))?.plan ?? 0;

/** The number in a field; null if there is none, or the filter cannot have it. */
function filterValue(name, text) {
  const value = text === null || text.trim() === "" ? NaN : Number(text);
  return value >= 0 && value <= (name === "reach" ? 1 : Number.MAX_VALUE) ? value : null;
}

const findMatching = () => { matching = d3.range(data.ids.length).filter(meets); };

function meets(plan) {
  const { reward, survivors, node, reach } = state.filters;
  const [expected, alive] = data.objectives[plan];
  if (reward !== null && expected < reward - SLACK * data.total) return false;
  if (survivors !== null && alive < survivors - SLACK * data.robots) return false;
  if (node === null) return true;
  if (reach === null) return reachCode(plan, node) > 0;
  return (reachOf(plan, "reached_values").get(node) ?? 0) >= reach - SLACK;
}

const past = { walked: -Infinity, timer: null };

/** Change the state and remember it: as a step of its own, or as part of the same walk. */
function change(changes, walking = false) {
  const now = performance.now();
  const goesOn = walking && now - past.walked < PAUSE;
  if (!goesOn && past.timer !== null) remember("replaceState");
  past.walked = walking ? now : -Infinity;
  Object.assign(state, changes);
  if (!goesOn) return remember("pushState");
  clearTimeout(past.timer); // browsers refuse hundreds of changes within seconds
  past.timer = setTimeout(() => remember("replaceState"), 150);
}

function remember(how) {
  forget();
  if (location.hash === toHash()) return; // Back undoes something each time
  try {
    history[how](null, "", toHash());
  } catch { /* a frame in a notebook may have no address: then the view is not kept */ }
}

/** Drop what was not written yet: the address has changed. */
function forget() {
  clearTimeout(past.timer);
  past.timer = null;
}
