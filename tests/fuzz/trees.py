"""Changes of JSON and YAML as trees, written with what no library would write."""

import copy
import json
from collections.abc import Callable, Iterator
from random import Random
from typing import Any

from ruamel.yaml import YAML

from tests.fuzz.bits import PATHS

Place = tuple[Any, ...]


class Raw(str):
    """Text that is written as it is."""


class Twice(list):
    """Values of a key that is written once for each."""


def _nested(depth: int, begin: str = "[", end: str = "]") -> Raw:
    return Raw(begin * depth + "0" + end * depth)


VALUES: list[Any] = [
    *(None, True, False, 0, 1, 2, -1, 3, 0.5, -0.0, 1e308, -1e308, 5e-324, 10**30, 2**63, -(2**63)),
    *(Raw("NaN"), Raw("Infinity"), Raw("-Infinity"), Raw("1e999"), Raw("9" * 400), Raw("9" * 5000)),
    *(
        "",
        "a",
        "toy",
        "1",
        "0.5",
        "nan",
        "inf",
        "\0",
        "\r\n",
        "\x1b[31m",
        "\u202e",
        "😀",
        "é",
        "%s",
    ),
    *(Raw('"\\ud800"'), Raw('"\\udfff"'), Raw('"\\ufffe"'), "x" * 200, "x" * 5_000, "$(touch x)"),
    *([], {}, [[]], [None], [0], [1, 2], [1, [2, [3]]], {"a": 1}, {"": None}, [0] * 1_000),
    *(_nested(45), _nested(60), _nested(500), _nested(30_000), _nested(900, '{"a":', "}")),
    *({"id": {}}, {"__class__": "x"}, "botohe_moo:BOACO", "os:system", "a:b", [0.5, 0.5], [1, "a"]),
    *PATHS,
]
YAML_VALUES = [
    Raw(text)
    for text in (
        *("*a", "&a [*a]", "&a {b: *a}", "!x", "!!str 5", "!!int x", "!!binary eA==", "!!set {a}"),
        *("!!python/object/apply:os.system ['touch x']", "!!python/name:os.system", "!!float x"),
        *("{<<: *a}", "{<<: {a: 1}}", "{<<: 1}", "{<<: [{a: 1}, {b: 2}]}", "? a", "| ", "> ", "~"),
        *(".inf", ".nan", "-.inf", "0o10", "0x10", "1:30", "2026-13-32", "yes", "9_9", "1e-2"),
    )
]
KEYS = ["", "id", "name", "source", "base", "robots", "a", "x" * 300, "\0", "é", "<<", "__init__"]


def read_json(data: bytes) -> Any:
    return json.loads(data)


def write_json(value: Any) -> str:
    """Write a tree; keys of a Twice are written several times."""
    if isinstance(value, Raw):
        return str(value)
    if isinstance(value, Twice):  # not under a key any more
        return write_json(list(value))
    if isinstance(value, dict):
        pairs = (
            f"{write_json(key if isinstance(key, Raw) else str(key))}: {write_json(item)}"
            for key, items in value.items()
            for item in (items if isinstance(items, Twice) else [items])
        )
        return "{" + ", ".join(pairs) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(write_json, value)) + "]"
    return json.dumps(value, ensure_ascii=False)


def change_json(rng: Random, data: bytes) -> bytes:
    return _changed(rng, json.loads(data), VALUES)


def change_yaml(rng: Random, data: bytes) -> bytes:
    """Give a YAML text with changed values, in braces and brackets as JSON has them."""
    return _changed(rng, YAML(typ="safe", pure=True).load(data), VALUES + YAML_VALUES * 3)


def _changed(rng: Random, tree: Any, values: list[Any]) -> bytes:
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        tree = change_tree(rng, tree, values)
    return write_json(tree).encode(errors="surrogatepass")


def places(value: Any, path: Place = ()) -> Iterator[Place]:
    """Give all paths into nested lists and dicts, the empty one first."""
    yield path
    if isinstance(value, dict | list):
        for key, item in list(value.items() if isinstance(value, dict) else enumerate(value)):
            yield from places(item, (*path, key))


def at(tree: Any, place: Place) -> Any:
    for step in place:
        tree = tree[step]
    return tree


def change_tree(rng: Random, tree: Any, values: list[Any]) -> Any:
    """Give a tree with one change; the tree itself may be changed."""
    everywhere = list(places(tree))
    place = rng.choice(everywhere)
    if not place:
        place = rng.choice(everywhere)  # of the whole tree, less often
    found = at(tree, place)
    new = rng.choice(_WAYS)(rng, tree, found, values, everywhere)
    return _put(rng, tree, place, new)


def _put(rng: Random, tree: Any, place: Place, new: Any) -> Any:
    if not place:
        return None if new is _GONE else new
    owner, key = at(tree, place[:-1]), place[-1]
    way = rng.random()
    if new is _GONE:
        del owner[key]
    elif isinstance(owner, dict) and way < 0.05:
        owner[key] = Twice([owner[key], new])
    elif isinstance(owner, dict) and way < 0.1:
        other = rng.choice(KEYS if rng.random() < 0.5 else [*owner])
        owner[other] = owner.pop(key)
    elif isinstance(owner, list) and not isinstance(owner, Twice) and way < 0.1:
        owner.insert(rng.randrange(len(owner) + 1), new)
    else:
        owner[key] = new
    return tree


_GONE = object()
_Way = Callable[[Random, Any, Any, list[Any], list[Place]], Any]


def _any_value(rng: Random, tree: Any, found: Any, values: list[Any], _: list[Place]) -> Any:
    return copy.deepcopy(rng.choice(values))


def _no_value(rng: Random, tree: Any, found: Any, values: list[Any], _: list[Place]) -> Any:
    return _GONE


def _of_another_place(
    rng: Random, tree: Any, found: Any, values: list[Any], everywhere: list[Place]
) -> Any:
    return copy.deepcopy(at(tree, rng.choice(everywhere)))


def _near_by(rng: Random, tree: Any, found: Any, values: list[Any], _: list[Place]) -> Any:
    """Give a number, a text or a list that is a little different."""
    if isinstance(found, bool) or found is None or isinstance(found, Raw):
        return not found
    if isinstance(found, int | float):
        ways = (found + 1, -found, found * 1000, found / 2, found + 1e-9, str(found), float(found))
        return rng.choice(ways)
    if isinstance(found, str):
        part = found[: rng.randrange(len(found) + 1)]
        ways = (part, found.upper(), found + "x", f" {found} ", found * 50, [found], f"../{found}")
        return rng.choice(ways)
    if isinstance(found, list):
        items = list(found)
        cut = rng.randrange(len(items) + 1)
        some = items[cut : cut + 1]
        ways = (items[:cut], items[::-1], items + some, items + some * 500, [items], items[cut:])
        return copy.deepcopy(rng.choice(ways))
    ways = ([found], list(found), list(found.values()), {"a": found}, {**found, "extra": 1})
    return copy.deepcopy(rng.choice(ways))


_WAYS: tuple[_Way, ...] = (_any_value, _any_value, _no_value, _of_another_place, _near_by, _near_by)
