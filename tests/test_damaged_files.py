"""Files that were changed at random: they are read as something of use, or refused by name.

``make fuzz`` reads 100 000 of each form: 500 times 200. Files of studies are damaged in
``tests/study``.
"""

import contextlib
import copy
import gzip
import json
import re
import shutil
import sys
import traceback
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import Mission, load_mission, mission_from_tables, read_solution, solve
from botohe_moo.base.files import read_table
from botohe_moo.bounds import FrontBound, bound_front
from botohe_moo.library import BestKnown, Finder
from botohe_moo.mission import MissionError, read_mission, save_mission
from botohe_moo.mission.model import mission_digest
from tests.examples import examples
from tests.mission.made import feature

pytestmark = pytest.mark.fuzz
DATA = Path(__file__).parent / "data"

# What stands between quotes, between elements, or between separators.
VALUE = re.compile(rb'(?<=")[^"\n]+(?=")|(?<=>)[^<>\n]+(?=<)|[0-9.]+')
TOKENS = [
    *(b"", b"NaN", b"-Infinity", b"nan", b"1e999", b"-1", b"1" * 30, b"9" * 5000, b"\xff", b"\0"),
    *(b"&#13;", b"&x;", b"&#xFFFE;", b"]]>", b"<!DOCTYPE a []>", b"\r", b" ", b";", b"\xc2\x85"),
    *(b"null", b"{}", b"[", b'"', b'"base": 1,', b"\\ud800", b"1_0", b"../../x"),
]
VALUES = [
    *(None, True, 0, 2, -1, 0.5, -0.0, 1e308, 10**400, float("nan"), float("inf"), "", "a", "\0"),
    *([], [1, 2], [[None]], [float("nan"), 0], {}, {"a": 1}, {"id": {}}, "x" * 3000),
]
KEYS = ["id", "source", "name", "title", "base", "robots", "pos", "x", "", "\0", "max_length"]


class Watch:
    """Notes what is unpickled, started or connected to while files are read."""

    CALLS = ("pickle.find_class", "subprocess.Popen", "os.system", "os.exec", "socket.connect")

    def __init__(self):
        self.seen, self.on = [], False
        sys.addaudithook(self.note)

    def note(self, event, args):
        if self.on and event in self.CALLS and not self.of_numba():
            self.seen.append((event, args))

    @staticmethod
    def of_numba():
        """Tell whether numba's cache of kernels is being read, which is pickled."""
        callers = (frame.f_globals.get("__name__", "") for frame, _ in traceback.walk_stack(None))
        return any(name.startswith("numba.") for name in callers)

    @contextlib.contextmanager
    def over(self):
        self.on = True
        try:
            yield
        finally:
            self.on = False
        assert self.seen == []


WATCH = Watch()


@st.composite
def changed_bytes(draw, data, value=VALUE, tokens=TOKENS):
    """Bytes with one to three stretches replaced, cut off or put elsewhere."""
    for _ in range(draw(st.integers(1, 3))):
        begin = draw(st.integers(0, len(data)))
        end = min(len(data), begin + draw(st.sampled_from([0, 0, 1, 3, 20, 10**6])))
        if (whole := list(value.finditer(data))) and draw(st.booleans()):
            begin, end = draw(st.sampled_from(whole)).span()
        data = data[:begin] + draw(st.sampled_from(tokens) | st.binary(max_size=2)) + data[end:]
    return data


def places(value, path=()):
    """All paths into nested lists and objects but the empty one."""
    if isinstance(value, dict | list):
        for key, item in value.items() if isinstance(value, dict) else enumerate(value):
            yield (*path, key)
            yield from places(item, (*path, key))


@st.composite
def changed_json(draw, data):
    """A JSON text with one to three values set, taken out, added or repeated."""
    content = json.loads(data)
    for _ in range(draw(st.integers(1, 3))):
        path = draw(st.sampled_from(list(places(content)) or [()]))
        if not path:
            break
        owner = content
        for key in path[:-1]:
            owner = owner[key]
        value = copy.deepcopy(draw(st.sampled_from(VALUES)))
        change = draw(st.sampled_from(["set", "set", "delete", "add", "repeat"]))
        if change == "set":
            owner[path[-1]] = value
        elif change == "delete":
            del owner[path[-1]]
        elif isinstance(owner, dict):
            owner[draw(st.sampled_from(KEYS))] = value
        else:
            owner.insert(0, owner[-1] if change == "repeat" else value)
    return json.dumps(content).encode()


def changed(data, *, is_json=False, value=VALUE):
    found = changed_bytes(data, value)
    return found if not is_json else found | changed_json(data)


def check_message(error, named):
    """What is said has to be read by people, and to name the file."""
    lines = str(error).splitlines()
    assert str(named) in str(error)
    assert len(lines) <= 102  # a hundred faults
    assert max(map(len, lines)) < 2000


def read_or_refused(read, *args, named, errors=ValueError, **given):
    """Return what is read; None if the error names the file."""
    try:
        with WATCH.over():
            return read(*args, **given)
    except errors as error:
        check_message(error, named)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("damaged")


POINTS = [feature("Point", [i, 1], id=i, frame="map", metadata={"reward": i}) for i in range(3)]
LINES = [
    feature("LineString", [[0, 1]], id=10, startid=i, endid=j, metadata={"survival": 0.5})
    for i, j in ((0, 1), (1, 2), (2, 0), (2, 1))
]
SITE = {"features": [*POINTS, *LINES], "mission": {"base": 0, "robots": 2}}
FORMS = {  # of missions: a suffix, and a file
    "json": (DATA / "pier.json").read_bytes(),
    "graphml": (DATA / "gephi.graphml").read_bytes(),
    "txt": (DATA / "points.txt").read_bytes(),
    "geojson": json.dumps(SITE).encode(),
}


def read_and_saved(path, data, **given):
    """Read a changed mission; what can be read can be saved, and comes back."""
    path.write_bytes(data)
    mission = read_or_refused(read_mission, path, named=path, errors=MissionError, **given)
    if mission is None:
        return
    saved = path.with_name("saved.json")
    try:
        save_mission(mission, saved)
    except ValueError as error:
        assert "surrogates" in str(error)  # noqa: PT017 - no file can hold a lone one
        check_message(error, saved)
        return
    again = read_mission(saved)
    assert again == mission
    assert (again.name, again.title) == (mission.name, mission.title)
    assert mission_digest(again) == mission_digest(mission)


@pytest.mark.filterwarnings("ignore:Left out")
@pytest.mark.parametrize("suffix", FORMS)
@examples(200)
@given(draw=st.data())
def test_missions(suffix, folder, draw):
    data = draw.draw(changed(FORMS[suffix], is_json=suffix.endswith("json")))
    read_and_saved(folder / f"mission.{suffix}", data)


NODES = b"label,reward,x,y,zone\ndock,0,0,0,\nreef,5,1,0.5,north\nwreck,2.5,,,south\n"
ARCS = b"tail,head,survival,length\ndock,reef,0.9,2\nreef,wreck,0.8,\ndock,wreck,1,3.5\n"


@examples(200)
@given(nodes=changed(NODES) | st.just(NODES), arcs=changed(ARCS))
def test_tables(folder, nodes, arcs):
    tables = []
    for name, data in {"nodes.csv": nodes, "arcs.csv": arcs}.items():
        path = folder / name
        path.write_bytes(data)
        tables.append(read_or_refused(read_table, path, named=path))
    if all(table is not None for table in tables):
        given = {"base": "dock", "robots": 2, "both_ways": True, "errors": MissionError}
        mission = read_or_refused(mission_from_tables, *tables, named="", **given)
        assert mission is None or isinstance(mission, Mission)


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """A solution, and the bytes of its files."""
    folder = tmp_path_factory.mktemp("solved")
    solution = solve("toy", "greedy", evaluations=100)
    solution.write(folder)
    return solution, {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


@examples(200)
@given(draw=st.data())
def test_a_solution(folder, solved, draw):
    solution, files = solved
    name = draw.draw(st.sampled_from(sorted(files)))
    data = draw.draw(changed(files[name], is_json=name.endswith(".json")))
    place = folder / "solution"
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir()
    for other, whole in files.items():
        (place / other).write_bytes(data if other == name else whole)
    read = read_or_refused(read_solution, place, named=place, errors=(ValueError, OSError))
    if read is not None:
        # A plan that adds no area may be gone.
        assert {*read.plans} <= {*solution.plans}
        assert read.area == pytest.approx(solution.area)
        assert read.objectives == pytest.approx(read.mission.evaluate(read.plans))
        read.describe()
        read.choose("survivors >= 1")


TOY = load_mission("toy")


@pytest.fixture(scope="module")
def bound(tmp_path_factory):
    path = tmp_path_factory.mktemp("bound") / "bound.json"
    bound_front(TOY, time_limit=1).save(path)
    return path.read_bytes()


@examples(200)
@given(draw=st.data())
def test_a_bound(folder, bound, draw):
    path = folder / "bound.json"
    path.write_bytes(draw.draw(changed(bound, is_json=True)))
    read = read_or_refused(FrontBound.load, path, TOY, named=path, errors=(ValueError, OSError))
    assert read is None or 0 <= read.area <= 1


@examples(200)
@given(draw=st.data(), packed=st.booleans())
def test_a_best_known_front(folder, draw, packed):
    plans = [TOY.plan([trail, [1]]) for trail in ([1, 3, 2, 4, 2, 3, 1], [1, 3, 1], [1])]
    known = BestKnown(TOY).merged(plans, Finder("2026-11-27", "Ada", "by hand"))
    data = draw.draw(changed(known.to_bytes(), is_json=True))
    path = folder / ("toy.front.json.gz" if packed else "toy.front.json")
    whole = gzip.compress(data, mtime=0)
    path.write_bytes(draw.draw(changed(whole) | st.just(whole)) if packed else data)
    read = read_or_refused(BestKnown.read, path, TOY, named=path)
    if read is None:
        return
    try:
        read.check()
    except ValueError as error:
        check_message(error, "")
    else:
        # A changed trail may be as good as the one that was there.
        assert read.objectives == pytest.approx(read.mission.evaluate(read.plans))
        assert 0 <= read.area <= known.area + 1e-9
