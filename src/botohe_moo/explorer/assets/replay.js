// The replay: a plan of the data is that of a step, and a node's code the share of its reward that counts.

const HOLD = 2000; // milliseconds to read what happened
const CROSS = "M-11,-11L11,11M-11,11L11,-11";
const APART = ROUND + 4; // of robots beside each other
const ANY = [0, 0]; // a trail that leaves, so that each robot has a style of its own

let step = 0, playing = null, styles = [], crosses = null;

const last = () => data.plans.length - 1;
const isLost = (robot, at = step) => data.lost[at].includes(robot);

/** The node where a robot is, or both of the arc on which it was lost. */
function whereIs(robot, at) {
  const [trail, i] = [trailsOf(at)[robot], data.at[at][robot]];
  return trail.slice(i, i + (isLost(robot, at) ? 2 : 1));
}

/** Where robots are drawn: those in the same place beside each other. */
function spotsOf(at) {
  const robots = d3.range(data.robots);
  const places = robots.map((robot) => whereIs(robot, at));
  const together = d3.group(robots, (robot) => String([...places[robot]].sort(ascending)));
  const spots = [];
  for (const group of together.values()) {
    const columns = Math.ceil(Math.sqrt(group.length));
    const rows = Math.ceil(group.length / columns);
    group.forEach((robot, i) => {
      const [x, y] = [0, 1].map((axis) => d3.mean(places[robot], (node) => map.at[node][axis]));
      const [column, row] = [i % columns, Math.floor(i / columns)];
      spots[robot] = [x + APART * (column - (columns - 1) / 2), y + APART * (row - (rows - 1) / 2)];
    });
  }
  return spots;
}

function drawRobots(spots) {
  const robots = spots.map((spot, robot) => ({ label: String(robot), ...styles[robot], spot }));
  markers(map.robots, robots, ({ spot }) => `translate(${spot})`).classed("lost", (_, robot) => isLost(robot));
  crosses.selectAll("path").data(robots.filter((_, robot) => isLost(robot))).join("path").attr("d", CROSS)
    .attr("transform", ({ spot }) => `translate(${spot})`);
}

/** Where robots have been, where they are to go, and where they were to go if the plan was made anew. */
function drawTrails() {
  const before = trailsOf(Math.max(step - 1, 0));
  map.drawWays(trailsOf(step).flatMap((trail, robot) => {
    const at = data.at[step][robot];
    const part = (look, nodes, changes = {}) => ({ trail: nodes, look, ...styles[robot], ...changes });
    const walked = part("walked", trail.slice(0, at + 1));
    if (isLost(robot)) return [walked];
    const old = trail === before[robot] ? [] : [part("old", before[robot].slice(at), { dash: "0 5" })];
    return [walked, ...old, part("", trail.slice(at))];
  }));
}

function whereText(robot) {
  const names = whereIs(robot, step).map((node) => isolated(data.names[node]));
  return isLost(robot) ? `lost between ${names.join(" and ")}` : `at ${names[0]}`;
}

function showRobots() {
  const ahead = (trail, robot) => (isLost(robot) ? [] : trail.slice(data.at[step][robot] + 1));
  const way = (nodes) => nodes.map((node) => isolated(data.names[node])).join(" → ");
  fillTable("robots", [
    ["robot", false, (_, robot) => rowHead(make("span", { class: "robot" }, sampleOf(styles[robot], ANY), robot))],
    data.kinds.length && ["kind", false, (_, robot) => make("td", {}, kindOf(robot))],
    ["is", false, (_, robot) => make("td", { class: "where" }, whereText(robot))],
    ["is to go to", false, (trail, robot) => make("td", { class: "way" }, way(ahead(trail, robot)))],
  ], trailsOf(step));
}

/** Buttons that lead to the losses. */
function listLosses() {
  const lossy = d3.range(1, last() + 1).filter((at) => data.lost[at].length > data.lost[at - 1].length);
  byId("marks").replaceChildren(...lossy.map((at) => {
    const robots = data.lost[at].filter((robot) => !isLost(robot, at - 1)).map(robotText);
    const said = `Step ${at}: ${robots.join(", ")} lost`;
    return make("li", {}, make("button", { type: "button", onclick: () => go(at) }, said));
  }));
}

function render() {
  map.fillNodes(reachOf(step));
  drawTrails();
  drawRobots(spotsOf(step));
  const where = d3.range(data.robots).map((robot) => `${robotText(robot)} ${whereText(robot)}`);
  map.svg.attr("aria-label", `Map of step ${step}: ${where.join(", ")}.`);
  byId("step-title").textContent = `Step ${step} of ${last()}`;
  byId("at-hand").replaceChildren(make("strong", {},
    `Reward so far: ${data.banked[step]}. Robots alive: ${data.robots - data.lost[step].length} of ${data.robots}.`));
  byId("said").textContent = data.said[step];
  showRobots();
  tellNode(tellNode.node ?? null);
  tellUnnamed();
  showSlider(step, last(), data.said[step], [step > 0, step < last()]);
  enable(byId("play"), last() > 0);
  byId("play").textContent = playing ? "Stop" : "Play";
}

function nodeText(node) {
  const code = reachCode(step, node);
  if (code === 0) return "not visited";
  return code === LITTLE ? "visited, does not count" : `visited, ${probability(code)} of it counts`;
}

function show(at) {
  step = Math.min(Math.max(Math.trunc(at) || 0, 0), last());
  try {
    history.replaceState(null, "", `#step=${step}`);
  } catch { /* browsers refuse hundreds of changes within seconds */ }
  render();
  say(data.said[step]);
}

function go(at) {
  stop();
  show(at);
}

function stop() {
  playing?.stop();
  playing = null;
}

/** Let robots move to where they are at the next step, and go on from there. */
function play() {
  if (step === last()) show(0);
  const [from, to] = [spotsOf(step), spotsOf(step + 1)];
  const [still, pace] = [isStill(), paceOf(last())];
  playing = d3.timer((elapsed) => {
    const part = Math.min(elapsed / pace, 1);
    if (part < 1) {
      if (!still) drawRobots(from.map(([x, y], i) => [x + part * (to[i][0] - x), y + part * (to[i][1] - y)]));
      return;
    }
    stop();
    if (step + 1 < last()) playing = d3.timeout(play, data.told.includes(step + 1) ? HOLD : 0);
    show(step + 1);
  });
  byId("play").textContent = "Stop";
}

/** A mission in which nobody leaves has no step to play. */
function togglePlay() {
  if (!playing) return last() > 0 && play();
  stop();
  render();
}

function onKey(event) {
  const { target, key } = event;
  if (isCommand(event)) return;
  const by = stepOf(event);
  if (by) go(step + by);
  else if (key === " " && !target.closest("button, summary")) togglePlay();
  else if (key === "Escape" && playing) togglePlay();
  else return;
  event.preventDefault();
}

const resize = () => zoom(1);
const restore = () => go(new URLSearchParams(location.hash.slice(1)).get("step"));

openPage(() => {
  styles = stylesOf(d3.range(data.robots).map(() => ANY));
  crosses = map.svg.insert("g", ".robots").attr("class", "crosses");
  listLosses();
  resize();
  restore();
  document.addEventListener("keydown", onKey);
  window.addEventListener("hashchange", restore);
  byId("walk").addEventListener("input", (event) => go(event.target.value));
  onClicks({ less: () => go(step - 1), more: () => go(step + 1), play: togglePlay });
}).catch((error) => complain(error.message));
