"""Changes of the files of an input, each in the way of its format."""

from collections.abc import Callable
from pathlib import PurePath
from random import Random

from tests.fuzz.bits import change_bytes, change_words
from tests.fuzz.cells import change_csv, change_points
from tests.fuzz.markup import change_xml
from tests.fuzz.oracle import Files, Odd
from tests.fuzz.trees import change_json, change_yaml

_Change = Callable[[Random, bytes], bytes]
_BY_SUFFIX: dict[str, _Change] = {
    ".json": change_json,
    ".graphml": change_xml,
    ".yaml": change_yaml,
    ".csv": change_csv,
    ".txt": change_points,
}
_TEXTS = (".json", ".graphml", ".yaml", ".csv", ".txt")
_OF_BYTES = 0.3  # how often bytes change, and the file need not stay one of its format
_OF_FILES = 0.03  # how often files are exchanged, missing or something else


def change_file(rng: Random, name: str, data: bytes) -> bytes:
    """Give a file with changes: of what it holds, of its words or of its bytes."""
    suffix = PurePath(name).suffix or ".json"  # as a hidden one is
    if suffix in _BY_SUFFIX and rng.random() > _OF_BYTES:
        return _BY_SUFFIX[suffix](rng, data)
    change = change_words if suffix in _TEXTS and rng.random() < 0.5 else change_bytes
    for _ in range(rng.choice((1, 1, 2, 4))):
        data = change(rng, data)
    return data


def change_files(rng: Random, files: Files, among: Callable[[str], bool] | None = None) -> Files:
    """Give the files of an input, one or two of which are changed."""
    changed = dict(files)
    names = sorted(name for name in files if among is None or among(name))
    for name in rng.sample(names, min(len(names), rng.choice((1, 1, 1, 2)))):
        data = files[name]
        assert isinstance(data, bytes)
        if rng.random() > _OF_FILES:
            changed[name] = change_file(rng, name, data)
        else:
            changed[name] = rng.choice([*Odd, b"", files[rng.choice(sorted(files))]])
    return changed
