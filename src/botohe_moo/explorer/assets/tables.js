// Tables and sentences: everything that the pictures show, as text.

const N_NODES_COMPARED = 25;

const cell = (content, attributes = {}) => make("td", { class: "number", ...attributes }, content);

/** A probability with its bar. */
function barCell(code) {
  const bar = make("span", { class: "bar" });
  bar.style.width = `${100 * share(code)}%`;
  return make("td", { class: "number" }, make("span", { class: "room" }, bar), probability(code));
}

const letterOf = (plan) => (state.pins.includes(plan) ? ` (${LETTERS[state.pins.indexOf(plan)]})` : "");

function showAtHand(plan) {
  const said = `${title(plan)}${letterOf(plan)}: reward ${rewardOf(plan)}, survivors ${survivorsOf(plan)}`;
  const names = marksOf(plan).map((mark) => mark.name);
  if (!matching.includes(plan)) names.push(`${title(plan).toLowerCase()} does not meet the filters`);
  const tags = names.map((name) => make("span", { class: "tag" }, name));
  byId("at-hand").replaceChildren(make("strong", {}, said), ...tags);
  byId("plan-title").textContent = `${title(plan)}${letterOf(plan)} of the front`;
  const why = marksOf(plan).flatMap((mark) => mark.text);
  byId("why").replaceChildren(...[...new Set(why)].map((text) => make("li", {}, text)));
  return [said, ...names].join("; ");
}

function symbol(kind) {
  const svg = d3.create("svg").attr("class", "symbol").attr("viewBox", "-9 -9 18 18").attr("aria-hidden", "true");
  if (SYMBOLS[kind]) svg.append("path").attr("class", `mark ${kind}`).attr("d", d3.symbol(SYMBOLS[kind], 110)());
  return svg.node();
}

/** The marked plans, each once, from the most survivors to the most reward; rows lead to them. */
function listMarks(go) {
  const plans = d3.sort(d3.group(data.marks, (mark) => mark.plan), ([plan]) => plan);
  const kindOfMark = (marks) => (marks.find((mark) => SYMBOLS[mark.kind]) ?? marks[0]).kind;
  fillTable("marks", [
    ["plan", false, ([plan, marks]) => rowHead(make("button", { type: "button" }, symbol(kindOfMark(marks)), title(plan)))],
    ["reward", true, ([plan]) => cell(rewardOf(plan))],
    ["survivors", true, ([plan]) => cell(survivorsOf(plan))],
    ["marked as", false, ([, marks]) => make("td", {}, marks.map((mark) => mark.name).join("; "))],
  ], plans, ([plan]) => ({ "data-plan": plan, onclick: () => go(plan) }));
}

function showMarks(plan) {
  for (const row of byId("marks").tBodies[0].rows) {
    row.querySelector("button").setAttribute("aria-current", String(Number(row.dataset.plan) === plan));
  }
}

/** The robots of a plan with their trails, and beside the map a button for each. */
function showRobots(plan, alone) {
  const trails = trailsOf(plan);
  const styles = stylesOf(trails);
  const sample = (robot) => sampleOf(styles[robot], trails[robot]);
  const rewards = data.trail_reward_texts;
  const way = (trail) => (trail.length > 1 ? trail.map((node) => isolated(data.names[node])).join(" → ")
    : `stays at ${whereStays(trail)}`);
  fillTable("robots", [
    ["robot", false, (_, robot) => rowHead(make("span", { class: "robot" }, sample(robot), robot))],
    data.kinds.length && ["kind", false, (_, robot) => make("td", {}, kindOf(robot))],
    ["survives", true, (_, robot) => barCell(survivalCode(plan, robot))],
    rewards.length && scenario === null && ["brings alone", true, (number) => cell(rewards[number])],
    ["length", true, (number) => cell(data.trail_length_texts[number])],
    ["nodes", true, (number) => cell(new Set(data.trails[number]).size - 1)],
    ["trail", false, (number) => make("td", { class: "way" }, way(data.trails[number]))],
  ], data.plans[plan]);
  const team = byId("team"); // its buttons stay, since one may have the focus
  if (!team.children.length) team.append(...trails.map((_, robot) => make("button", { type: "button", class: "robot",
    "data-robot": robot, "aria-label": `${robotText(robot)} alone`, onclick: () => alone(robot) })));
  for (const [robot, button] of [...team.children].entries()) {
    button.setAttribute("aria-pressed", String(state.robot === robot));
    button.replaceChildren(sample(robot), robotName(robot));
  }
}

/** The plan at hand and the pinned ones side by side. */
function showComparison(plan) {
  const plans = [plan, ...state.pins.filter((pin) => pin !== plan)];
  const alone = `What ${title(plan).toLowerCase()} may bring`;
  byId("compare-title").textContent = plans.length > 1 ? "Side by side" : alone;
  const row = (name, make_) => make("tr", {}, rowHead(name), ...plans.map(make_));
  const group = (name) =>
    make("tr", { class: "group" }, make("th", { scope: "rowgroup", colspan: plans.length + 1 }, name));
  const head = plans.map((one) => columnHead(`${title(one)}${letterOf(one)}`));
  const bodies = [[
    row("Expected reward", (one) => cell(rewardOf(one))),
    row("Expected survivors", (one) => cell(survivorsOf(one))),
    ...Object.entries(data.facts).map(([name, facts]) => row(name, (one) => cell(facts[one]))),
    row("Survivals of the robots", (one) => cell(survivalTexts(one), { class: "number wrap" })),
  ]];
  bodies.push([group("Probability of the number of survivors"),
    ...d3.range(data.robots + 1).map((n) => row(n, (one) => barCell(data.survivors[one][n])))]);
  const about = plans.some((one) => data.simulated[one]) ? ` (${simulatedText(plans)})` : "";
  bodies.push([group(`Probability of the reward, lower limits included${about}`),
    ...data.bins.map((name, i) => row(name, (one) => barCell(data.rewards_in[one][i])))]);
  if (plans.length > 1) bodies.push(differingRows(plans, row, group));
  const body = bodies.map((rows) => make("tbody", {}, ...rows));
  byId("compare").replaceChildren(make("thead", {}, make("tr", {}, make("td"), ...head)), ...body);
  showWords(plans);
}

function survivalTexts(plan) {
  const robots = data.plans[plan].map((trail, robot) => [data.trail_codes[trail], robot]);
  const sorted = d3.sort(robots, ([, robot]) => data.kind_of[robot] ?? 0, ([code]) => -share(code));
  return sorted.map(([code, robot]) => `${data.kinds.length ? `${kindOf(robot)} ` : ""}${probability(code)}`).join(", ");
}

function simulatedText(plans) {
  const which = plans.filter((plan) => data.simulated[plan]).map((plan) => title(plan).toLowerCase());
  return `simulated with ${data.n_samples} missions for ${which.join(", ")}`;
}

/** Nodes that not all plans reach with the same probability, the largest differences first. */
function differingRows(plans, row, group) {
  const spread = (node) => {
    const shares = plans.map((plan) => share(reachCode(plan, node)));
    return d3.max(shares) - d3.min(shares);
  };
  const nodes = [...new Set(plans.flatMap((plan) => [...reachOf(plan).keys()]))];
  const sorted = d3.sort(nodes.filter((node) => spread(node) > 0), (a, b) => spread(b) - spread(a) || a - b);
  if (!sorted.length) return [group("All nodes are reached with the same probabilities")];
  const shown = sorted.slice(0, N_NODES_COMPARED);
  const rest = sorted.length - shown.length;
  const more = rest ? `; ${rest} more differ less` : "";
  return [group(`Probability that a node is reached, where plans differ${more}`),
    ...shown.map((node) => row(nodeName(node), (plan) => barCell(reachCode(plan, node))))];
}

/** Differences in words, for pairs that were compared: neighbours and marked plans. */
function showWords(plans) {
  const beside = d3.pairs([plans[0] - 1, plans[0], plans[0] + 1]);
  const pairs = plans.length > 1 ? plans.flatMap((one, i) => plans.slice(i + 1).map((other) => [one, other])) : beside;
  const blocks = pairs.map((pair, i) => {
    const [first, second] = pair.sort(ascending);
    const name = `From ${title(first).toLowerCase()} (first) to ${title(second).toLowerCase()} (second)`;
    return { name, sentences: data.words[`${first}-${second}`] ?? [], key: `${i} of ${pairs.length}` };
  });
  const details = d3.select("#words").selectAll("details").data(blocks, (block) => block.key).join((enter) => {
    const added = enter.append("details").attr("open", pairs.length === 1 ? "" : null);
    added.append("summary");
    added.append("ul").attr("class", "sentences");
    return added;
  });
  details.attr("hidden", ({ sentences }) => (sentences.length ? null : "")); // stays, and so does whether it is open
  details.select("summary").text(({ name }) => name);
  details.select("ul").selectAll("li").data(({ sentences }) => sentences).join("li").text(String);
  byId("words-note").hidden = plans.length === 1 || blocks.every(({ sentences }) => sentences.length);
}

/** The table of the nodes on the trails in the order of visit, which is filled while it is open. */
function showNodes(plan) {
  const reach = [...reachShown(plan)].filter(([node]) => node !== data.base);
  const counted = reach.length === 1 ? "1 node" : `${reach.length} nodes`;
  byId("nodes-details").firstElementChild.textContent = `${counted}, the base not counted`;
  if (!byId("nodes-details").open) return;
  const visits = d3.range(data.robots).flatMap((robot) => journeyOf(plan, robot)
    .filter((visit) => visit.isFirst).map((visit) => ({ robot, ...visit })));
  const byNode = d3.group(visits, (visit) => visit.node);
  const firstAt = (node) => d3.min(byNode.get(node), (visit) => visit.length);
  const collected = data.collected.length && scenario === null ? reachOf(plan, "collected") : null;
  fillTable("nodes", [
    ["node", false, ([node]) => rowHead(nodeName(node))],
    ["visited after", true, ([node]) => cell(lengthOf(firstAt(node)))],
    ["reward", true, ([node]) => cell(data.reward_texts[node])],
    ["reached", true, ([, code]) => barCell(code)],
    collected && ["collected", true, ([node]) => (data.rewards[node] > 0 ? barCell(collected.get(node)) : cell(""))],
    ["by robots", false, ([node]) => make("td", {}, byNode.get(node).map((visit) => robotName(visit.robot)).join(", "))],
  ], d3.sort(reach, ([node]) => firstAt(node)));
}

/** A card with a small map for each pinned plan; made anew only when pins change. */
function showPinned(go, unpin) {
  byId("pinned").hidden = !state.pins.length;
  const shown = String([scenario, ...state.pins]);
  if (showPinned.last === shown) return;
  showPinned.last = shown;
  showPinned.maps = [];
  const within = byId("cards").contains(document.activeElement);
  byId("cards").replaceChildren(...state.pins.map((plan, i) => {
    const svg = d3.create("svg").attr("role", "img").node();
    const map = new SiteMap(svg);
    map.resize(260, true);
    map.show(plan);
    showPinned.maps.push(map);
    const button = (name, act) => make("button",
      { type: "button", onclick: () => act(plan), "aria-label": `${name} ${title(plan).toLowerCase()}` }, name);
    return make("article", {},
      make("h3", {}, `${LETTERS[i]}: ${title(plan).toLowerCase()}`),
      make("p", { class: "caption" }, `reward ${rewardOf(plan)}, survivors ${survivorsOf(plan)}`),
      svg,
      make("div", { class: "actions" }, button("Show", go), button("Unpin", unpin)));
  }));
  if (within) byId("pin").focus(); // the button that was pressed is gone
}
