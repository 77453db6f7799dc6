// Connects the parts: what the reader does changes the state, and the state is drawn.

let front = null, stopAnimation = null;
let preview = null; // a plan that the pointer is on
const FILE_BUTTONS = [...document.querySelectorAll("[data-file]")];

/** Draw the state: pictures at once, and tables too, except on a walk: then after the pictures. */
function render(walking = false) {
  stopAnimation?.();
  const plan = preview ?? state.plan;
  front.show(plan);
  map.show(plan, state.robot);
  const said = showAtHand(plan);
  showWalk(said);
  byId("pin").textContent = state.pins.includes(plan) ? "Unpin" : "Pin";
  showAnimate(plan);
  tellNode(tellNode.node ?? null); // of this plan
  tellUnnamed();
  if (preview === null) say(said);
  cancelAnimationFrame(render.later);
  if (walking) render.later = requestAnimationFrame(() => setTimeout(renderTables));
  else renderTables();
}

function renderTables() {
  const plan = preview ?? state.plan;
  showRobots(plan, alone);
  showStrips(plan);
  showComparison(plan);
  showNodes(plan);
  showPinned(go, togglePin);
  showMarks(plan);
  const faults = FILE_BUTTONS.map(({ dataset: { file } }) => (file === "svg" ? "" : fileOf(plan, file)[1]));
  FILE_BUTTONS.forEach((button, i) => enable(button, faults[i] === ""));
  byId("no-files").textContent = [...new Set(faults)].join(" ").trim();
}

/** Keys work on the plan at hand: show it, not the one that the pointer rests on. */
function endPreview() {
  if (preview === null) return;
  preview = null;
  render();
}

/** Show trails and the map in a scenario, or over all. */
function showScenario(event) {
  scenario = event.target.value === "" ? null : Number(event.target.value);
  act({});
  drawScenario();
}

function drawScenario() {
  byId("scenario").value = scenario ?? "";
  tellDangers();
  map.drawGround();
}

function showWalk(said) {
  const ways = [-1, 1].map((by) => beside(by) !== undefined);
  showSlider(d3.bisectLeft(matching, state.plan), Math.max(matching.length - 1, 0), said, ways);
  enable(byId("walk"), matching.length > 0);
}

function showAnimate(plan) {
  enable(byId("animate"), trailsOf(plan).some((trail) => trail.length > 1));
  byId("animate").textContent = stopAnimation ? "Stop" : "Animate";
  if (!stopAnimation) byId("moment").textContent = "";
}

function act(changes, walking = false) {
  preview = null;
  complain(""); // what was wrong with the address no longer matters
  change(changes, walking);
  render(walking);
}

const go = (plan) => plan !== state.plan && act({ plan });
const alone = (robot) => act({ robot: state.robot === robot ? null : robot });

/** The next plan that meets the filters; the one at hand need not. */
const beside = (by) =>
  matching[by > 0 ? d3.bisectRight(matching, state.plan) : d3.bisectLeft(matching, state.plan) - 1];

function step(by) {
  const plan = beside(by);
  if (plan !== undefined) act({ plan }, true);
}

function togglePin(plan) {
  if (state.pins.includes(plan)) return act({ pins: state.pins.filter((pin) => pin !== plan) });
  if (state.pins.length < MAX_PINS) return act({ plan, pins: [...state.pins, plan] });
  act({ plan });
  byId("at-hand").append(make("span", { class: "tag" }, "four plans are pinned: unpin one first"));
  return say("Four plans are pinned: unpin one first.");
}

function filter() {
  state.filters = Object.fromEntries(FILTERS.map((name) => [name, filterValue(name, byId(`filter-${name}`).value)]));
  findMatching();
  const nearest = d3.least(matching, (plan) => Math.abs(plan - state.plan)); // itself, if it meets them
  act({ plan: nearest ?? state.plan }, true);
  showFilters();
  say(`${byId("matching").textContent} ${byId("filter-faults").textContent}`);
}

function showFilters() {
  const none = data.thinned ? "None of the plans shown" : "No plan";
  const faults = matching.length ? [] : [`${none} meets these filters.`];
  for (const name of FILTERS) {
    const field = byId(`filter-${name}`);
    if (filterValue(name, field.value) !== state.filters[name]) field.value = state.filters[name] ?? "";
    const wrong = state.filters[name] === null && (field.value !== "" || field.validity.badInput);
    field.setAttribute("aria-invalid", wrong);
    if (wrong) faults.push(`Expected ${field.dataset.expected}: this filter is off.`);
  }
  byId("filter-faults").textContent = faults.join(" ");
  enable(byId("filter-reach"), state.filters.node !== null);
  const all = data.ids.length === 1 ? "1 plan" : `${data.ids.length} plans`;
  byId("matching").textContent = matching.length === data.ids.length ? all : `${matching.length} of ${all}`;
  front.sift();
}

/** Show what the address says. */
function restore() {
  forget();
  past.walked = -Infinity; // what follows is another walk, however soon
  preview = null;
  complain(readHash());
  showFilters();
  drawScenario();
  render();
}

/** Let robots on maps of plans move, all as fast as each other; gives a function that stops them. */
function animate(maps, say, ended) {
  const ways = maps.flatMap((one) => one.ways);
  const [hops, longest] = [d3.max(ways, (way) => way.hops.length), d3.max(ways, (way) => way.journey.at(-1).length)];
  const [still, pace] = [isStill(), paceOf(hops)];
  const timer = d3.timer((elapsed) => {
    const time = (still ? Math.floor(elapsed / pace) : elapsed / pace) / hops;
    if (time > 1) return stop();
    say(time * longest, longest);
    return maps.forEach((one) => one.drawRobots(time * longest, still));
  });
  const stop = () => {
    timer.stop();
    for (const one of maps) one.robots.selectAll("*").remove();
    ended();
  };
  return stop;
}

function toggleAnimation() {
  const ended = () => { stopAnimation = null; showAnimate(state.plan); };
  if (stopAnimation) return stopAnimation();
  const tell = (gone, longest) => { byId("moment").textContent = `length ${lengthOf(gone)} of ${lengthOf(longest)}`; };
  stopAnimation = animate([map, ...showPinned.maps], tell, ended);
  return showAnimate(state.plan);
}

function onKey(event) {
  const { target, key } = event;
  if (isCommand(event)) return;
  if (key === "Escape") stopAnimation?.();
  if (target.id !== "walk" && target.closest("input, select, textarea")) return;
  const by = stepOf(event);
  if (key === "Enter" && !target.closest("button, a, summary")) togglePin(state.plan);
  else if (by) step(by);
  else return;
  event.preventDefault();
}

function listen() {
  for (const cause of ["keydown", "focusin"]) document.addEventListener(cause, endPreview);
  document.addEventListener("keydown", onKey);
  window.addEventListener("popstate", restore);
  byId("walk").addEventListener("input", (event) => act({ plan: matching[event.target.value] }, true));
  onClicks({ less: () => step(-1), more: () => step(1), pin: () => togglePin(state.plan), animate: toggleAnimation });
  byId("scenario").addEventListener("change", showScenario);
  byId("filters").addEventListener("input", filter);
  byId("filters").addEventListener("reset", () => setTimeout(filter));
  byId("filters").addEventListener("submit", (event) => event.preventDefault());
  byId("nodes-details").addEventListener("toggle", () => showNodes(preview ?? state.plan));
  for (const one of FILE_BUTTONS) one.addEventListener("click", () => download(state.plan, one.dataset.file));
  const chart = byId("front");
  chart.addEventListener("click", (event) => {
    const plan = front.nearest(event);
    if (plan !== null) togglePin(plan);
  });
  chart.addEventListener("pointermove", (event) => event.pointerType !== "touch" && hover(front.nearest(event)));
  chart.addEventListener("pointerleave", () => hover(null));
}

function hover(plan) {
  const shown = plan === state.plan ? null : plan;
  if (shown === preview) return;
  preview = shown;
  cancelAnimationFrame(hover.frame);
  hover.frame = requestAnimationFrame(() => render(true));
}

/** What there is to say of a node with the plan that is shown. */
function nodeText(node) {
  return `reached with ${probability(reachShown(preview ?? state.plan).get(node) ?? 0)}`;
}

function resize() {
  front.resize(Math.max(byId("front").parentElement.clientWidth, 200));
  front.sift();
  const strips = byId("strips");
  const columns = getComputedStyle(strips).gridTemplateColumns.split(" ");
  showStrips.width = Math.max(parseFloat(columns[0]), 200);
  strips.replaceChildren(); // they have the width of before
  zoom(1);
}

openPage(() => {
  byId("thinned").textContent = data.thinned;
  byId("address").hidden = location.href === "about:srcdoc"; // a frame in a notebook has no history of its own
  byId("filter-node").append(...data.names.map((name, node) =>
    make("option", { value: node, dir: "auto" }, shortened(name, 60))));
  byId("scenarios").hidden = data.scenarios.length === 1;
  byId("scenario").append(...data.scenarios.map(([name, chance], i) =>
    make("option", { value: i, dir: "auto" }, `${name} (${probability(codeOf(chance))})`)));
  byId("nodes-details").open = byId("key").open && data.names.length <= 60;
  front = new FrontChart(byId("front"));
  readHash();
  listMarks(go);
  resize();
  restore();
  listen();
}).catch((error) => complain(error.message));
