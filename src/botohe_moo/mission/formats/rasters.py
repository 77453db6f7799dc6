"""Maps as the map server of Nav2 reads them: YAML that names an image."""

from __future__ import annotations

import os
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import numpy as np
from PIL import Image, UnidentifiedImageError
from pydantic import AfterValidator, BaseModel, Field

from botohe_moo._base.checks import quoted
from botohe_moo._base.document import Document
from botohe_moo._base.files import read_bytes
from botohe_moo._base.types import FloatArray
from botohe_moo.mission.formats.documents import file_content, validated
from botohe_moo.mission.validation import MissionError

MODES = ("trinary", "scale")

_Finite = Annotated[float, Field(strict=True, allow_inf_nan=False)]


def _without_rotation(origin: list[float]) -> list[float]:
    if any(origin[2:]):
        raise ValueError("expected [x, y, 0], without rotation")
    return origin


class _MapFile(BaseModel):
    image: Annotated[str, Field(min_length=1)]
    resolution: Annotated[_Finite, Field(gt=0)]
    origin: Annotated[
        list[_Finite], Field(min_length=2, max_length=3), AfterValidator(_without_rotation)
    ]
    negate: Literal[0, 1] = 0
    mode: Literal["trinary", "scale"] = "trinary"
    free_thresh: Annotated[float, Field(strict=True, gt=0, lt=1)] = 0.25  # as Nav2 saves maps


class Raster(NamedTuple):
    """A map of shares, as `survival_from_raster` takes it."""

    values: FloatArray  # in [0, 1], the first row at the top (n_rows, n_columns)
    resolution: float  # width of a cell
    origin: tuple[float, float]  # the lower left corner
    free_thresh: float  # in a map of obstacles, cells with less are free


def read_raster(path: str | os.PathLike[str], *, modes: Sequence[str] = ("scale",)) -> Raster:
    """Read a map as shares of full scale, which is black, or with ``negate`` white.

    Its ``mode`` has to be one of ``modes``; without one it is ``trinary``, as for the map server. A
    MissionError names the file, and the line of what is wrong. In mode ``raw``, which is never one
    of them, pixels are not shares.
    """
    path = Path(path)
    try:
        document = Document(file_content(path).decode("utf-8-sig"))
        if not isinstance(document.content, dict):
            raise MissionError(f"expected a map, with an image, got {quoted(document.content)}")
        found = validated(document, _MapFile)
        if found.mode not in modes:
            got = quoted(document.content["mode"]) if "mode" in document.content else "none"
            expected = f"expected mode to be {' or '.join(modes)}, found {got}"
            raise MissionError(f"line {document.line(['mode'])}: {expected}")
        try:
            shares = _read_image(path.parent / found.image)
        except ValueError as error:
            raise MissionError(f"image {quoted(found.image)}: {error}") from None
    except MissionError as error:
        raise MissionError(list(error.faults), str(path)) from None
    except ValueError as error:  # DocumentError, and text that is not UTF-8
        raise MissionError(str(error).rstrip("."), str(path)) from None
    x, y, *_ = found.origin
    values = shares if found.negate else 1.0 - shares
    return Raster(values, found.resolution, (x, y), found.free_thresh)


def _read_image(path: Path) -> FloatArray:
    """Read an image as shares of white (n_rows, n_columns); a ValueError says why it cannot be."""
    try:
        with Image.open(BytesIO(read_bytes(path))) as image:
            if image.mode == "F":
                raise ValueError("expected integers as pixels, found floats")
            # Of 16 bits or more; others have at most 8 for each colour, of which the mean counts.
            most = 65_535.0 if image.mode.startswith("I") else 255.0
            pixels = np.asarray(image if most > 255.0 else image.convert("RGB"), float)
    except FileNotFoundError:
        raise ValueError("there is no such file") from None
    except UnidentifiedImageError:
        raise ValueError("expected an image, such as PNG or PGM") from None
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror or error}") from None
    except (SyntaxError, Image.DecompressionBombError) as error:
        raise ValueError(f"cannot be read: {error}") from None
    grey = pixels if pixels.ndim == 2 else pixels.mean(axis=2)
    shares: FloatArray = np.clip(grey / most, 0.0, 1.0)
    return shares
