// What pages have around the map of the site: its size, what is said of nodes, and how a page opens.
// Each page has a `render` that draws all, a `resize`, and a `nodeText` that says more of a node.

let map = null;

/** Tell screen readers; of several texts at once only the last. */
function say(text) {
  clearTimeout(say.timer);
  say.timer = setTimeout(() => { byId("status").textContent = text; }, 200);
}

function complain(fault) {
  byId("problem").textContent = fault;
  byId("problem").hidden = fault === "";
}

/** Tell what there is to say of a node, or of an arc if there is no node near the pointer. */
function tellNode(node, arc = null) {
  tellNode.node = node;
  map.point(node);
  if (node === null) return byId("node").replaceChildren(...(arc === null ? [] : arcText(arc)));
  const note = data.node_notes[node] ? `; ${data.node_notes[node]}` : "";
  return byId("node").replaceChildren(nodeName(node),
    `: reward ${data.reward_texts[node]}, ${nodeText(node)}${note}`);
}

/** What each kind survives of an arc and of its opposite. */
function arcText(arc) {
  const [tails, heads] = data.arcs;
  const survival = (one) => data.kinds.map((kind, i) => {
    const code = scenario === null ? data.arc_codes[i][one] : codeOf(data.arc_survival[scenario][i][one]);
    return code ? `${kind} survives with ${probability(code)}` : `not for ${kind}`;
  }).join(", ");
  const back = tails.findIndex((tail, i) => tail === heads[arc] && heads[i] === tails[arc]);
  const same = back >= 0 && survival(back) === survival(arc);
  const way = (one, sign) => [nodeName(tails[one]), ` ${sign} `, nodeName(heads[one]), `: ${survival(one)}`];
  return [...way(arc, same ? "–" : "→"), ...(back < 0 || same ? [] : ["; ", ...way(back, "→")])];
}

/** Draw the map larger or smaller; the frame around it scrolls. */
function zoom(factor) {
  const before = zoom.factor ?? 1;
  zoom.factor = Math.min(Math.max(before * factor, 1), 8);
  const ratio = zoom.factor / before;
  const frame = byId("map").closest(".frame");
  const [x, y] = [frame.scrollLeft + frame.clientWidth / 2, frame.scrollTop + frame.clientHeight / 2];
  const width = Math.max(Math.round(zoom.factor * frame.parentElement.clientWidth), 200);
  map.resize(width);
  byId("map").parentElement.style.width = zoom.factor > 1 ? `${width}px` : "";
  if (zoom.factor === 1) frame.style.maxHeight = `${map.height + 2}px`;
  frame.scrollTo(x * ratio - frame.clientWidth / 2, y * ratio - frame.clientHeight / 2);
  enable(byId("smaller"), zoom.factor > 1);
  enable(byId("larger"), zoom.factor < 8);
  render();
}

/** Show where the slider is, and whether there is something on each of its sides. */
function showSlider(at, most, said, [less, more]) {
  Object.assign(byId("walk"), { max: most, value: at });
  byId("walk").setAttribute("aria-valuetext", said);
  enable(byId("less"), less);
  enable(byId("more"), more);
}

const isCommand = (event) => event.altKey || event.ctrlKey || event.metaKey || event.defaultPrevented;

/** The step that an arrow key asks for, unless it scrolls. */
const stepOf = ({ target, key }) => (target.closest(".scroll, .frame") ? 0 : { ArrowLeft: -1, ArrowRight: 1 }[key]);

function onClicks(answers) {
  for (const [id, answer] of Object.entries(answers)) byId(id).addEventListener("click", answer);
}

/** Tell how many names are not on the map. */
function tellUnnamed() {
  const [all, unnamed] = [data.names.length, data.names.length - map.named.length];
  byId("unnamed").textContent = unnamed === 0 ? ""
    : `Names of ${unnamed} of ${all} nodes have no room on the map: point at a node to read it.`;
}

/** Show what the darkest and the lightest arcs mean. */
function tellDangers() {
  const codes = arcCodes();
  const [safe, risky] = [d3.max, d3.min].map((of) => of(codes, share));
  byId("safest").textContent = probability(codes.find((code) => share(code) === safe));
  byId("riskiest").textContent = probability(codes.find((code) => share(code) === risky));
}

/** Unpack the data, show what all pages say of the site, and let the page fill in the rest. */
async function openPage(fill) {
  if (!("DecompressionStream" in window)) {
    throw new Error("This browser cannot unpack the page's data. "
      + "Chrome and Edge from 111, Firefox from 113 and Safari from 16.4 can.");
  }
  data = await unpack(byId("data").textContent);
  byId("about").textContent = data.about;
  byId("placing").textContent = data.placing;
  byId("kinds").textContent = data.key;
  tellDangers();
  byId("key").open = !window.matchMedia("(max-width: 30rem)").matches;
  byId("main").hidden = false;
  map = new SiteMap(byId("map"), byId("ground"));
  fill();
  document.addEventListener("click", (event) => {
    if (event.target.closest('[aria-disabled="true"]')) event.stopPropagation();
  }, true);
  byId("larger").addEventListener("click", () => zoom(2));
  byId("smaller").addEventListener("click", () => zoom(0.5));
  const onMap = (event) => tellNode(map.nearest(event), data.kinds.length ? map.nearestArc(event) : null);
  for (const cause of ["pointermove", "pointerdown"]) byId("map").addEventListener(cause, onMap);
  byId("map").addEventListener("pointerleave", (event) => event.pointerType !== "touch" && tellNode(null));
  window.addEventListener("resize", resize);
  window.matchMedia("screen and (prefers-color-scheme: dark)").addEventListener("change", () => map.drawGround());
}
