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
from botohe_moo.plots.draw.places import node_positions

MAX_BYTES = 1_500_000
CHROMIUM = "/usr/bin/chromium"
REPEATS, STEPS = 3, 30

# Tell when a page is complete: when an element is there, and seen.
WATCH = """new MutationObserver(() => {
    const seen = document.querySelector(SEEN);
    if (seen && window.seenAt === undefined)
        requestAnimationFrame(() => setTimeout(() => { window.seenAt ??= performance.now(); }));
}).observe(document, { childList: true, subtree: true, attributes: true });"""
# Script is what a step costs in its event; the time to the next picture includes waiting for it.
WALK = """async (n) => {
    const found = [];
    for (let i = 0; i < n; i += 1) {
        const started = performance.now();
        await window.oneStep(i);
        const script = performance.now() - started;
        await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
        found.push([script, performance.now() - started]);
    }
    return found;
}"""
STEP_EXPLORER = """window.oneStep = () => {
    const walk = document.getElementById("walk");
    walk.value = Number(walk.value) + (Number(walk.value) < walk.max ? 1 : -1);
    walk.dispatchEvent(new Event("input", { bubbles: true }));
};"""
STEP_PLOTLY = """window.oneStep = (i) => Plotly.animate(document.querySelector(".plotly-graph-div"),
    [`${250 + i}`], { mode: "immediate", frame: { duration: 0 }, transition: { duration: 0 } });"""


def run(folder: Path) -> bool:
    """Print and write the table; whether the explorer's page is small enough."""
    mission = load_mission("terrain", nodes=1_000, robots=10)
    solution = solve(mission, evaluations=100_000, seed=1)
    data = page_data(solution)
    with tempfile.TemporaryDirectory(prefix="botohe-explorer-") as made:
        page = Path(made, "explorer.html")
        page.write_text(render(mission.title, data), "utf-8")
        rows = [measured(page, "#main:not([hidden])", STEP_EXPLORER)]
        try:
            beside = plotly_page(solution, data["ids"], Path(made, "plotly.html"))
        except ImportError:
            print("Plotly is not installed (the extra bench): only the explorer is measured.")
        else:
            rows.append(measured(beside, ".plotly-graph-div .main-svg", STEP_PLOTLY))
    table = pd.DataFrame(rows).assign(plans=len(data["ids"]), nodes=1_000, robots=10)
    print(table.to_string(index=False))
    table.to_csv(folder / "explorer.csv", index=False)
    return int(table["bytes"].iloc[0]) <= MAX_BYTES


def measured(path: Path, seen: str, step: str) -> dict[str, Any]:
    """Medians of milliseconds: first paint, complete, and a step until its picture."""
    from playwright.sync_api import sync_playwright

    paints, complete, steps = [], [], []
    with sync_playwright() as playwright:
        options = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=options)
        for _ in range(REPEATS):
            page = browser.new_page(viewport={"width": 1280, "height": 900}, bypass_csp=True)
            page.add_init_script(WATCH.replace("SEEN", repr(seen)) + step)
            page.goto(path.as_uri())
            page.wait_for_function("window.seenAt !== undefined", timeout=120_000)
            complete.append(page.evaluate("window.seenAt"))
            name = "performance.getEntriesByName('first-contentful-paint')[0].startTime"
            paints.append(page.evaluate(name))
            page.evaluate(WALK, 5)
            steps += page.evaluate(WALK, STEPS)
            page.close()
        browser.close()
    pictures = sorted(picture for _, picture in steps)
    return {
        "page": path.stem,
        "bytes": path.stat().st_size,
        "first_paint_ms": round(statistics.median(paints)),
        "complete_ms": round(statistics.median(complete)),
        "step_script_ms": round(statistics.median(script for script, _ in steps), 1),
        "step_ms": round(statistics.median(pictures), 1),
        "step_95_ms": round(pictures[int(0.95 * len(pictures))], 1),
    }


def plotly_page(solution: Solution, rows: list[int], path: Path) -> Path:
    """Write the page that one would write with Plotly: a front, a map, and a slider of frames."""
    import plotly.graph_objects as go
    from plotly.subplots import make_subplots

    mission = solution.mission
    xy = node_positions(mission).round(4)
    ends = zip(mission.arrays.tail.tolist(), mission.arrays.head.tolist(), strict=True)
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
