"""The explorer's page: size, first paint and a step along the front.

Measured in Chromium on a front of 500 plans of ten robots on 1 000 nodes.
"""

import statistics
import tempfile
from pathlib import Path
from typing import Any

import pandas as pd

from botohe_moo import load_mission, solve
from botohe_moo.explorer.data import page_data
from botohe_moo.explorer.page import render

MAX_BYTES = 1_500_000
CHROMIUM = "/usr/bin/chromium"
REPEATS, STEPS = 5, 20

# Tell when a page is complete: when an element is there, and seen.
WATCH = """new MutationObserver(() => {
    const seen = document.querySelector("#main:not([hidden])");
    if (seen && window.seenAt === undefined)
        requestAnimationFrame(() => setTimeout(() => { window.seenAt ??= performance.now(); }));
}).observe(document, { childList: true, subtree: true, attributes: true });"""
# A key is pressed as by a hand; the browser says how long it takes until the next picture, in steps
# of 8 ms (Event Timing, the measure behind "interaction to next paint").
PRESSES = """window.presses = []; new PerformanceObserver((list) => {
    const pressed = list.getEntries().filter((one) => one.name === "keydown");
    window.presses.push(...pressed.map((one) => one.duration));
}).observe({ type: "event", durationThreshold: 16 });"""


def press(page: Any) -> list[float]:
    """Walk along the explorer's front by keys; milliseconds from each to its picture."""
    page.evaluate(PRESSES)
    for _ in range(STEPS):
        page.keyboard.press("ArrowLeft")
        page.wait_for_timeout(100)
    found: list[float] = page.evaluate("window.presses")
    return found + [16.0] * (STEPS - len(found))  # shorter ones are not told


def run(folder: Path) -> bool:
    """Print and write the table; whether the explorer's page is small enough."""
    mission = load_mission("terrain", nodes=1_000, robots=10)
    solution = solve(mission, evaluations=100_000, seed=1, n_islands=1)
    data = page_data(solution)
    with tempfile.TemporaryDirectory(prefix="botohe-explorer-") as made:
        page = Path(made, "explorer.html")
        page.write_text(render(mission.title, data), "utf-8")
        row = measured(page)
    table = pd.DataFrame([row]).assign(plans=len(data["ids"]), nodes=1_000, robots=10)
    print(table.to_string(index=False))
    table.to_csv(folder / "explorer.csv", index=False)
    return int(table["bytes"].iloc[0]) <= MAX_BYTES


def measured(path: Path) -> dict[str, Any]:
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
            page.add_init_script(WATCH)
            page.goto(path.as_uri())
            page.wait_for_function("window.seenAt !== undefined", timeout=120_000)
            name = "performance.getEntriesByName('first-contentful-paint')[0].startTime"
            steps = press(page)
            found.append(
                {
                    "first_paint_ms": page.evaluate(name),
                    "complete_ms": page.evaluate("window.seenAt"),
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
