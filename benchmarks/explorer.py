"""The explorer's page: size, first paint and a step along the front, beside a Plotly page.

Measured in Chromium on a front of 500 plans of ten robots on 1 000 nodes. The Plotly page shows the
same front and, for each plan, the same trails and probabilities, as frames of a slider. Without
Plotly (the extra ``bench``) only the explorer is measured.
"""

import statistics
import tempfile
from collections.abc import Callable
from itertools import chain
from pathlib import Path
from typing import Any

import pandas as pd

from botohe_moo import Solution, load_mission, solve
from botohe_moo.explorer.data import page_data
from botohe_moo.explorer.page import render
from botohe_moo.outcomes import reach_probabilities
from botohe_moo.plots.site import node_positions

MAX_BYTES = 1_500_000
CHROMIUM = "/usr/bin/chromium"
REPEATS, STEPS = 5, 20

# Tell when a page is complete: when an element is there, and seen.
WATCH = """new MutationObserver(() => {
    const seen = document.querySelector(SEEN);
    if (seen && window.seenAt === undefined)
        requestAnimationFrame(() => setTimeout(() => { window.seenAt ??= performance.now(); }));
}).observe(document, { childList: true, subtree: true, attributes: true });"""
# A key is pressed as by a hand; the browser says how long it takes until the next picture, in steps
# of 8 ms (Event Timing, the measure behind "interaction to next paint").
PRESSES = """window.presses = []; new PerformanceObserver((list) => {
    const pressed = list.getEntries().filter((one) => one.name === "keydown");
    window.presses.push(...pressed.map((one) => one.duration));
}).observe({ type: "event", durationThreshold: 16 });"""
# Plotly's slider takes no keys: a step is an animation without duration, and the picture after it.
ANIMATE = """async (n) => {
    const found = [];
    for (let i = 0; i < n; i += 1) {
        const started = performance.now();
        await Plotly.animate(document.querySelector(".plotly-graph-div"), [`${250 + i}`],
            { mode: "immediate", frame: { duration: 0 }, transition: { duration: 0 } });
        await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
        found.push(performance.now() - started);
    }
    return found;
}"""


def press(page: Any) -> list[float]:
    """Walk along the explorer's front by keys; milliseconds from each to its picture."""
    page.evaluate(PRESSES)
    for _ in range(STEPS):
        page.keyboard.press("ArrowLeft")
        page.wait_for_timeout(100)
    found: list[float] = page.evaluate("window.presses")
    return found + [16.0] * (STEPS - len(found))  # shorter ones are not told


def animate(page: Any) -> list[float]:
    """Walk along Plotly's frames; milliseconds from each step to its picture."""
    found: list[float] = page.evaluate(ANIMATE, STEPS)
    return found


def run(folder: Path) -> bool:
    """Print and write the table; whether the explorer's page is small enough."""
    mission = load_mission("terrain", nodes=1_000, robots=10)
    solution = solve(mission, evaluations=100_000, seed=1, n_islands=1)
    data = page_data(solution)
    with tempfile.TemporaryDirectory(prefix="botohe-explorer-") as made:
        page = Path(made, "explorer.html")
        page.write_text(render(mission.title, data), "utf-8")
        rows = [measured(page, "#main:not([hidden])", press)]
        try:
            beside = plotly_page(solution, data["ids"], Path(made, "plotly.html"))
        except ImportError:
            print("Plotly is not installed (the extra bench): only the explorer is measured.")
        else:
            rows.append(measured(beside, ".plotly-graph-div .main-svg", animate))
    table = pd.DataFrame(rows).assign(plans=len(data["ids"]), nodes=1_000, robots=10)
    print(table.to_string(index=False))
    table.to_csv(folder / "explorer.csv", index=False)
    return int(table["bytes"].iloc[0]) <= MAX_BYTES


def measured(path: Path, seen: str, walk: Callable[[Any], list[float]]) -> dict[str, Any]:
    """Milliseconds until the first paint, the complete page, and a step's picture.

    Of the repeats' medians the least counts: what else runs on a machine only ever adds time.
    """
    from playwright.sync_api import sync_playwright

    found = []
    with sync_playwright() as playwright:
        options = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=options)
        for _ in range(REPEATS):
            page = browser.new_page(viewport={"width": 1280, "height": 900}, bypass_csp=True)
            page.add_init_script(WATCH.replace("SEEN", repr(seen)))
            page.goto(path.as_uri())
            page.wait_for_function("window.seenAt !== undefined", timeout=120_000)
            name = "performance.getEntriesByName('first-contentful-paint')[0].startTime"
            session = page.context.new_cdp_session(page)
            session.send("Performance.enable", {"timeDomain": "threadTicks"})
            before = busy(session)
            steps = walk(page)
            found.append(
                {
                    "first_paint_ms": page.evaluate(name),
                    "complete_ms": page.evaluate("window.seenAt"),
                    "step_cpu_ms": (busy(session) - before) / STEPS,
                    "step_ms": statistics.median(steps),
                }
            )
            page.close()
        browser.close()
    least = pd.DataFrame(found).min().round(1)
    return {"page": path.stem, "bytes": path.stat().st_size, **least.to_dict()}


def photograph(page_file: Path, path: Path, address: str = "") -> None:
    """Take a picture of a page as it opens, if there is a browser."""
    if not Path(CHROMIUM).exists():
        print(f"There is no {CHROMIUM}: {path} stays as it is.")
        return
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1120, "height": 860})
        page.goto(page_file.as_uri() + address)
        page.wait_for_selector("#main:not([hidden])")
        page.screenshot(path=path)
        browser.close()
    print(path)


def busy(session: Any) -> float:
    """Milliseconds of processor time that the page's main thread has spent."""
    metrics = session.send("Performance.getMetrics")["metrics"]
    return next(1000 * one["value"] for one in metrics if one["name"] == "TaskDuration")


def plotly_page(solution: Solution, rows: list[int], path: Path) -> Path:
    """Write the page that one would write with Plotly: a front, a map, and a slider of frames."""
    import plotly.graph_objects as go
    from plotly.subplots import make_subplots

    mission = solution.mission
    xy = node_positions(mission).round(4)
    ends = zip(mission.world.graph.tail.tolist(), mission.world.graph.head.tolist(), strict=True)
    arcs = chain.from_iterable((tail, head, None) for tail, head in ends)
    ground = [(None, None) if node is None else xy[node] for node in arcs]
    figure = make_subplots(cols=2)
    lines: Callable[..., Any] = go.Scattergl
    figure.add_trace(lines(x=solution.objectives[rows, 0], y=solution.objectives[rows, 1]), 1, 1)
    figure.add_trace(lines(x=[x for x, _ in ground], y=[y for _, y in ground], mode="lines"), 1, 2)
    frames = []
    for place, row in enumerate(rows):
        plan = solution.plans[row]
        reached = 1 - (1 - reach_probabilities(mission, plan)).prod(axis=0)
        trails = [xy[list(trail)].T for trail in plan.trails]
        drawn = [go.Scatter(x=x, y=y, mode="lines") for x, y in trails]
        marker = {"color": reached.round(3), "cmin": 0, "cmax": 1}
        drawn.append(go.Scatter(x=xy[:, 0], y=xy[:, 1], mode="markers", marker=marker))
        frames.append(go.Frame(data=drawn, name=str(place), traces=list(range(2, 2 + len(drawn)))))
    for trace in frames[0].data:
        figure.add_trace(trace, 1, 2)
    figure.frames = frames
    steps = [{"method": "animate", "args": [[frame.name]], "label": frame.name} for frame in frames]
    figure.update_layout(sliders=[{"steps": steps}])
    figure.write_html(path, include_plotlyjs=True, auto_play=False)
    return path
