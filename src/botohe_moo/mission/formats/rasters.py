"""Maps as the map server of Nav2 reads them: YAML that names an image."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from PIL import Image, UnidentifiedImageError

from botohe_moo._base.checks import as_float, quoted
from botohe_moo._base.document import Document, DocumentError
from botohe_moo._base.files import read_bytes
from botohe_moo._base.types import FloatArray
from botohe_moo.mission.validation import MissionError

_NEEDED = ("image", "resolution", "origin")
MODES = ("trinary", "scale", "raw")
_FREE_THRESH = 0.25  # as the map saver of Nav2 writes it


class Raster(NamedTuple):
    """A map of shares, as `survival_from_raster` takes it."""

    values: FloatArray  # in [0, 1], the first row at the top (n_rows, n_columns)
    resolution: float  # width of a cell
    origin: tuple[float, float]  # the lower left corner
    free_thresh: float  # in a map of obstacles, cells with less are free


def read_raster(path: str | os.PathLike[str], *, modes: Sequence[str] = ("scale",)) -> Raster:
    """Read a map as shares of full scale, which is black, or with ``negate`` white.

    Its ``mode`` has to be one of ``modes``; without one it is ``trinary``, as for the map server. A
    MissionError names the file, and the line of what is wrong.
    """
    path = Path(path)
    try:
        text = read_bytes(path).decode("utf-8-sig")
        document = Document(text)
    except OSError as error:
        raise MissionError(f"the file cannot be read: {error.strerror}", str(path)) from None
    except (DocumentError, UnicodeDecodeError) as error:
        raise MissionError(str(error).rstrip("."), str(path)) from None
    content = document.content
    if not isinstance(content, dict):
        raise MissionError(f"expected {', '.join(_NEEDED)}, got {quoted(content)}", str(path))
    faults = [
        f"line {document.line([name])}: {fault}" if name in content else fault
        for name, fault in _faults(content, modes).items()
    ]
    if faults:
        raise MissionError(faults, str(path))
    try:
        shares = _read_image(path.parent / content["image"])
    except ValueError as error:
        raise MissionError(f"image {quoted(content['image'])}: {error}", str(path)) from None
    x, y = map(float, content["origin"][:2])
    values = shares if content.get("negate", 0) else 1.0 - shares
    free_thresh = float(content.get("free_thresh", _FREE_THRESH))
    return Raster(values, float(content["resolution"]), (x, y), free_thresh)


def _faults(content: dict[str, Any], modes: Sequence[str]) -> dict[str, str]:
    """Return what is wrong, by the name of the entry."""
    faults = {name: f"found no {name}" for name in _NEEDED if name not in content}
    image, negate = content.get("image"), content.get("negate", 0)
    mode, free_thresh = content.get("mode", MODES[0]), content.get("free_thresh", _FREE_THRESH)
    resolution, origin = content.get("resolution"), content.get("origin")
    numbers = [as_float(part) for part in origin] if isinstance(origin, list) else []
    is_place = len(numbers) in (2, 3) and bool(np.isfinite(numbers).all())
    checks: dict[str, tuple[bool, str, Any]] = {
        "image": (isinstance(image, str) and image != "", "the name of a file", image),
        "resolution": (0 < as_float(resolution) < np.inf, "a number > 0", resolution),
        "origin": (is_place and not any(numbers[2:]), "[x, y, 0], without rotation", origin),
        "negate": (negate in (0, 1), "0 or 1", negate),
        "mode": (mode in modes, " or ".join(modes), mode),
        "free_thresh": (0 < as_float(free_thresh) < 1, "a number in (0, 1)", free_thresh),
    }
    for name, (is_right, expected, found) in checks.items():
        if not is_right:
            faults.setdefault(name, f"expected {name} to be {expected}, got {quoted(found)}")
    return faults


def _read_image(path: Path) -> FloatArray:
    """Read an image as shares of white (n_rows, n_columns); a ValueError says why it cannot be."""
    try:
        with Image.open(path) as image:
            # Of 16 bits or more; others have at most 8 for each colour.
            most = 65_535.0 if image.mode.startswith("I") else 255.0
            pixels = np.asarray(image if most > 255.0 else image.convert("L"), float)
    except FileNotFoundError:
        raise ValueError("there is no such file") from None
    except UnidentifiedImageError:
        raise ValueError("expected an image, such as PNG or PGM") from None
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror or error}") from None
    except (SyntaxError, Image.DecompressionBombError) as error:
        raise ValueError(f"cannot be read: {error}") from None
    shares: FloatArray = np.clip(pixels / most, 0.0, 1.0)
    return shares
