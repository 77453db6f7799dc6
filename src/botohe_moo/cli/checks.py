"""What is checked before a search: that its results can be written."""

import contextlib
import tempfile
from collections.abc import Iterable
from pathlib import Path

from botohe_moo._plugins.checks import Fault


def check_folder(folder: Path) -> None:
    """Check that files can be written to a folder, which need not exist; nothing is left behind."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".botohe-", dir=folder):
            pass
    except OSError as error:
        reason = "it is a file" if folder.is_file() else error.strerror
        raise OSError(f"{folder}: expected a folder to write to; {reason}.") from None
    finally:
        for path in missing:
            with contextlib.suppress(OSError):
                path.rmdir()


def refuse(source: str, faults: Iterable[Fault]) -> None:
    """Raise a ValueError that names all faults of an algorithm or a mission, if there are any."""
    if faults := list(faults):
        raise ValueError(f"{source}: {' '.join(message for _, message in faults)}")
