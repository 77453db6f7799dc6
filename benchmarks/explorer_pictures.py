"""Pictures of the explorer's page on sites of 27 to 200 nodes: wide and narrow screens, and print.

``--before`` names another checkout, whose page of the same solution is drawn above this one's.
"""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import pandas as pd
from PIL import Image

from benchmarks.explorer import CHROMIUM
from benchmarks.start import HERE
from botohe_moo import load_mission, solve

SITES: dict[str, dict[str, Any]] = {
    "art_museum": {},
    "drones_and_rovers": {},
    "terrain": {"nodes": 50},
    "terrain_200": {},
}
WIDE, NARROW, PAPER = (1280, 900), (390, 844), (703, 1032)  # pixels of A4 within its margins
SCALE, GAP, COLOURS = 0.5, 12, 128
# Charts have the size of the screen in print, too.
STAY = "window.addEventListener('resize', (event) => event.stopImmediatePropagation(), true)"
HIGH = 1400  # pixels of a screen that are drawn


def run(folder: Path, before: Path | None = None) -> bool:
    """Draw a sheet for each site; write where its map begins, and how many pages it prints on."""
    if not Path(CHROMIUM).exists():
        print(f"There is no {CHROMIUM}: the pictures stay as they are.")
        return True
    from playwright.sync_api import sync_playwright

    checkouts = {"now": HERE} if before is None else {"before": before, "now": HERE}
    rows = []
    with tempfile.TemporaryDirectory() as made, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        for site, parameters in SITES.items():
            solution = Path(made, site)
            solve(load_mission(site, **parameters), evaluations=20_000, seed=1).write(solution)
            drawn = []
            for name, checkout in checkouts.items():
                page = written(checkout, solution, Path(made, f"{site}-{name}.html"))
                pictures, measured = photographed(browser, page, Path(made, "picture.png"))
                drawn.append(pictures)
                rows.append({"site": site, "page": name, **measured})
            picture = sheet(drawn).quantize(COLOURS, Image.Quantize.FASTOCTREE, dither=0)
            picture.save(folder / f"{site}.png", optimize=True)
            print(folder / f"{site}.png")
        browser.close()
    table = pd.DataFrame(rows)
    print(table.to_string(index=False))
    table.to_csv(folder / "screens.csv", index=False)
    return True


def written(checkout: Path, solution: Path, page: Path) -> Path:
    """Write the page of a solution as a checkout does."""
    command = ["-m", "botohe_moo.cli", "explore", solution, "--choose", "survivors >= 2"]
    environment = {**os.environ, "PYTHONPATH": str(checkout / "src")}
    command = [sys.executable, *command, "--out", page]
    subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL)
    return page


def photographed(browser: Any, file: Path, made: Path) -> tuple[list[Image.Image], dict[str, int]]:
    """Return pictures of a page, the printed ones last, and what was measured."""
    found, begins = [], 0
    for width, height in (WIDE, NARROW):
        page = browser.new_page(viewport={"width": width, "height": height})
        page.add_init_script(STAY)
        page.goto(file.as_uri())
        page.wait_for_selector("#main:not([hidden])")
        page.screenshot(path=made, full_page=True)
        with Image.open(made) as picture:
            found.append(picture.convert("RGB").crop((0, 0, width, min(picture.height, HIGH))))
        begins = round(page.locator("#map").bounding_box()["y"])
        if width == WIDE[0]:
            n_pages = len(re.findall(rb"/Type /Page\b", page.pdf(format="A4")))
            page.emulate_media(media="print")
            page.set_viewport_size({"width": PAPER[0], "height": PAPER[1]})
            page.screenshot(path=made, full_page=True)
            with Image.open(made) as picture:
                printed = picture.convert("RGB")
        page.close()
    parts = [(at, min(at + PAPER[1], printed.height)) for at in range(0, printed.height, PAPER[1])]
    found += [printed.crop((0, top, PAPER[0], low)) for top, low in parts]
    return found, {"map_begins_at": begins, "printed_pages": n_pages}


def sheet(rows: list[list[Image.Image]]) -> Image.Image:
    """Put rows of pictures on one."""
    small = [[one.resize([round(SCALE * n) for n in one.size]) for one in row] for row in rows]
    width = max(sum(one.width + GAP for one in row) for row in small) + GAP
    heights = [max(one.height for one in row) + GAP for row in small]
    found = Image.new("RGB", (width, sum(heights) + GAP), "#8a8f94")
    for i, row in enumerate(small):
        x = GAP
        for one in row:
            found.paste(one, (x, GAP + sum(heights[:i])))
            x += one.width + GAP
    return found
