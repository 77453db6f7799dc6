// Files of a plan, as Python has written them into the page, and the view as a picture.

const INLINED = ["fill", "fill-opacity", "stroke", "stroke-width", "stroke-opacity", "stroke-dasharray",
  "stroke-linejoin", "opacity", "font-size", "font-family", "font-weight", "text-anchor", "paint-order",
  "vector-effect"];

/** The file of a plan in a format, or why there is none. */
const fileOf = (plan, kind) => (kind === "svg" ? [viewSvg(), ""] : data.files[kind][plan]);

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
    href: URL.createObjectURL(new Blob([fileOf(plan, kind)[0]])),
    download: `${data.name.replace(/[^\p{L}\p{N}._-]+/gu, "_")}-plan-${data.ids[plan]}.${kind}`,
  });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
