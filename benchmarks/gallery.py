"""The pictures of the gallery: its page's own code draws them."""

import contextlib
import re
import shutil
from pathlib import Path

from PIL import Image

PAGE = Path(__file__).parents[1] / "docs" / "gallery.md"
WIDEST = 1_000  # pixels, enough for a page


def run(out: Path) -> bool:
    """Run the page's code in ``out`` and make its pictures small; the study goes again."""
    with contextlib.chdir(out):
        for code in re.findall(r"^```python\n(.*?)^```$", PAGE.read_text("utf-8"), re.M | re.S):
            exec(compile(code, PAGE.name, "exec"), {"__name__": "gallery"})
        shutil.rmtree("trial")
    make_small(out)
    return True


def make_small(folder: Path) -> None:
    """Make the pictures in a folder small."""
    for path in sorted(folder.glob("*.png")):
        with Image.open(path) as picture:
            small = picture.convert("RGB")
        small.thumbnail((WIDEST, WIDEST))
        small.save(path, optimize=True)
