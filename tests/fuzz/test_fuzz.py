"""A short round of ``make fuzz``; and what it looks for is found where it is."""

import os
import re
import sys
from random import Random

import pytest

from tests.fuzz import planted
from tests.fuzz.__main__ import is_sound
from tests.fuzz.child import get_ready, make_input
from tests.fuzz.driver import fuzz
from tests.fuzz.oracle import FaultError, Odd, Place, Watch, examine
from tests.fuzz.targets import TARGETS
from tests.fuzz.trees import change_json, write_json

# Others take too long for each input.
QUICK = {
    **dict.fromkeys(("node-link", "graphml", "benchmark", "tables", "solution", "bound"), 60),
    "plan": 60,
    "run": 60,
    "study-file": 20,
    "manifest": 20,
    "study-tables": 15,
    "commands": 30,
}


@pytest.fixture(scope="module")
def watch():
    return Watch()  # a hook, which stays


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # and back, when the test is done
    return Place(tmp_path / "place")


def test_a_short_round():
    counts = fuzz(QUICK, seed=2, workers=1)
    for name, count in counts.items():
        assert is_sound(count), (name, count)
        assert count.accepted + count.refused == QUICK[name]


def test_a_whole_round_is_large_enough():
    assert sum(target.inputs for target in TARGETS.values()) >= 100_000
    assert set(TARGETS) == set(QUICK)


def test_inputs_are_the_same_each_time():
    for target in (TARGETS["node-link"], TARGETS["run"], TARGETS["study-tables"]):
        inputs = [make_input(target, 3, number) for number in range(20)]
        assert inputs == [make_input(target, 3, number) for number in range(20)]
        assert len({tuple(files.items()) for files in inputs}) > 15


@pytest.mark.skipif(sys.platform != "linux", reason="the system tells no peak of memory elsewhere")
@pytest.mark.parametrize("name", planted.FAULTS)
def test_faults_are_found(name, place, watch):
    target, said = planted.PLANTED[name], planted.FAULTS[name][1]
    get_ready(target, place)
    with pytest.raises(FaultError) as caught:
        examine(target, {"a": b"sound"}, place, watch)
    assert re.search(said, str(caught.value))


def test_what_cannot_be_used_is_found(place, watch):
    target = planted.PLANTED["unusable"]
    get_ready(target, place)
    with pytest.raises(FaultError, match=r"cannot be used:\n(.*\n)+ZeroDivisionError"):
        examine(target, {"a": b"sound"}, place, watch)


def test_seeds_have_to_be_accepted(place):
    target = planted._target("bug", planted._bug)
    get_ready(target, place)
    target.ready.clear()
    with pytest.raises(KeyError):
        get_ready(target, place)


@pytest.mark.skipif(sys.platform != "linux", reason="addresses are limited on Linux only")
def test_faults_that_end_the_process_are_found():
    """The inputs after one that hangs or crashes are read, too, by another process."""
    inputs = {"sound": 30, "hang": 2, "crash": 1, "addresses": 1}
    counts = fuzz(inputs, seed=1, workers=1, module="tests.fuzz.planted", hang=0.5)
    assert is_sound(counts["sound"])
    assert counts["sound"].accepted + counts["sound"].refused == 30
    assert set(counts["hang"].faults) == {0, 1}
    assert "more than 0.5 s" in counts["hang"].faults[0]
    assert "_hang" in counts["hang"].faults[0]
    assert "status -6" in counts["crash"].faults[0]
    assert "MemoryError" in counts["addresses"].faults[0]
    assert not is_sound(counts["hang"])


def test_targets_that_refuse_all_or_nothing_are_not_sound():
    target = {"sound": 1}
    counts = fuzz(target, seed=1, workers=1, module="tests.fuzz.planted")
    assert not is_sound(counts["sound"])


def test_trees_are_written_as_nothing_else_would():
    written = {change_json(Random(i), b'{"a": [1, 2], "b": {"c": "d"}}') for i in range(500)}
    for piece in (b'"a": [1, 2], "a":', b"NaN", b"[[[[[[[[", b"999999999999", b"@OUTSIDE@"):
        assert any(piece in text for text in written), piece
    assert write_json({"a": [None, True, "é"]}) == '{"a": [null, true, "é"]}'


def test_files_may_be_anything(place):
    place.fill({"a/b": b"@OUTSIDE@/x", "c": Odd.FOLDER, "d": Odd.PIPE, "e": Odd.LOOP})
    assert (place.folder / "a" / "b").read_bytes() == os.fsencode(place.outside / "x")
    assert (place.folder / "c").is_dir()
    assert (place.folder / "d").is_fifo()
    with pytest.raises(OSError, match="symbolic links"):
        (place.folder / "e").read_bytes()
