"""Writing files so that no half-written file is ever found."""

import contextlib
import errno
import itertools
import os
import secrets
import stat
import tempfile
from collections.abc import Collection, Iterator
from pathlib import Path


@contextlib.contextmanager
def new_folder(wanted: Path) -> Iterator[Path]:
    """Make a folder that was not there; it is removed, with its parents, if it is left empty.

    Where there is a folder of the ``wanted`` name, ``-2``, ``-3`` and so on is added.
    """
    missing = [path for path in wanted.parents if not path.exists()]
    wanted.parent.mkdir(parents=True, exist_ok=True)
    made = wanted
    for number in itertools.count(2):
        try:
            made.mkdir()  # at once, so that no other process takes it
            break
        except FileExistsError:
            made = wanted.with_name(f"{wanted.name}-{number}")
    try:
        yield made
    finally:
        for path in (made, *missing):
            with contextlib.suppress(OSError):
                path.rmdir()


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


def read_bytes(path: Path) -> bytes:
    """Read a file; an OSError refuses devices and pipes, which may have no end."""
    _mode_of(path)
    return path.read_bytes()


def _mode_of(path: Path) -> int | None:
    """Return the permissions of a file, None if it is not there; refuse what is not a file."""
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return None
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, "expected a file, found a folder", str(path))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "expected a file, found a device or a pipe", str(path))
    return stat.S_IMODE(mode)


def check_parent(path: Path) -> None:
    """Refuse, with an OSError that names the folder, a file in a folder that does not exist."""
    folder = path.parent
    if not folder.exists():
        raise FileNotFoundError(errno.ENOENT, "there is no such folder", str(folder))
    if not folder.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "expected a folder, found a file", str(folder))


def suffix_fault(path: Path, known: Collection[str]) -> str:
    """Say what is wrong with the suffix of a file's name; nothing if it is a ``known`` one."""
    if path.suffix.lower() in known:
        return ""
    found = f"the suffix {path.suffix!r}" if path.suffix else "no suffix"
    return f"expected a file name that ends in one of {', '.join(known)}; found {found}"


def check_suffix(path: Path, known: Collection[str]) -> None:
    """Refuse, with a ValueError, a file name that has none of the ``known`` suffixes."""
    if fault := suffix_fault(path, known):
        raise ValueError(f"{path}: {fault}.")


def check_file(path: Path) -> None:
    """Refuse, with an OSError, a file in a folder that does not exist, or in place of a folder."""
    check_parent(path)
    _mode_of(path)


def replace_file(path: Path, data: bytes) -> None:
    """Write ``data`` to a file in one step: it appears complete, or stays as it was.

    A symlink stays: the file that it leads to is written, and keeps its permissions. An OSError
    refuses devices and pipes, which would be replaced by a file.
    """
    target = Path(os.path.realpath(path))
    check_parent(target)
    mode = _mode_of(path)
    temporary = target.with_name(f".{secrets.token_hex(8)}.tmp")
    try:
        with temporary.open("xb") as file:
            if mode is not None:
                temporary.chmod(mode)
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(target)
    except OSError as error:  # which would name the temporary file
        raise OSError(error.errno, error.strerror, str(path)) from None
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()
