"""What is checked before a search: that its results can be written and drawn."""

import contextlib
import tempfile
from pathlib import Path

from botohe_moo.mission.model import Mission
from botohe_moo.plots.draw.places import node_positions
from botohe_moo.solution.model import FILES

_OF_STUDIES = ("study.json", "study.yaml")


def check_folder(folder: Path) -> None:
    """Check that files can be written to a folder, which need not exist; nothing is left behind."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".botohe-", dir=folder):
            pass
        for name in FILES:
            if (folder / name).is_dir():
                raise IsADirectoryError(f"{name} is a folder in it")
        for name in _OF_STUDIES:
            if (folder / name).exists():
                raise FileExistsError(f"it holds a study, as {name} says")
    except OSError as error:
        reason = "it is a file" if folder.is_file() else error.strerror or error
        raise OSError(f"{folder}: expected a folder to write to; {reason}.") from None
    finally:
        for path in missing:
            with contextlib.suppress(OSError):
                path.rmdir()


def check_picture(mission: Mission) -> None:
    """Raise a ValueError that names a node whose ``pos`` is not a position."""
    if fault := place_fault(mission):
        raise ValueError(f"Mission {mission.name!r}: {fault}")


def place_fault(mission: Mission) -> str | None:
    """Name a node whose ``pos`` is not a position; None if there is none."""
    if any(place is None for _, place in mission.graph.nodes(data="pos")):
        return None  # the nodes will be laid out, which takes time
    try:
        node_positions(mission)
    except ValueError as error:
        return str(error)
    return None
