"""Algorithms and missions of other packages, from ``pip install`` to the command line and back.

The packages are wheels made by hand, so that pip needs neither a build backend nor a network, and
are installed by pip into a folder of their own, as ``pip install --target`` does.
"""

import base64
import csv
import functools
import hashlib
import os
import re
import shutil
import subprocess
import sys
import textwrap
import zipfile
from pathlib import Path
from typing import NamedTuple

import pytest

from botohe_moo.study import read_study
from tests.forked import run_forked

BOTOHE = Path(sys.executable).with_name("botohe")

# An algorithm that knows nothing of this package but the problem, and a mission.
DIVERS = '''
    """What divers do."""

    import networkx as nx
    import numpy as np
    from pydantic import Field
    from pymoo.core.algorithm import Algorithm
    from pymoo.core.population import Population
    from typing import Annotated

    from botohe_moo import Mission


    class Diver(Algorithm):
        """Dive at random, and keep what is best.

        Parameters
        ----------
        n_dives
            Dives in a generation.
        breath
            Share of the trails that go on.
        """

        def __init__(
            self,
            *,
            n_dives: Annotated[int, Field(ge=1, le=100)] = 8,
            breath: Annotated[float, Field(gt=0)],
            **options,
        ):
            super().__init__(**options)
            self.n_dives = n_dives
            self.breath = breath

        def _infill(self):
            mission = self.problem.mission
            plans = np.empty((self.n_dives, 1), object)
            for i in range(self.n_dives):
                trails = [self._trail(mission) for _ in range(mission.robots)]
                plans[i, 0] = mission.plan(trails)
            return Population.new("X", plans)

        _initialize_infill = _infill

        def _trail(self, mission):
            base = mission.base
            nodes = list(mission.graph.successors(base))
            node = nodes[self.random_state.integers(len(nodes))]
            if self.random_state.random() > self.breath or not mission.graph.has_edge(node, base):
                return [base]
            return [base, node, base]

        def _initialize_advance(self, infills=None, **kwargs):
            self._advance(infills, **kwargs)

        def _advance(self, infills=None, **kwargs):
            self.pop = infills if self.pop is None else Population.merge(self.pop, infills)


    def lagoon(*, depth: Annotated[int, Field(ge=1, le=50)] = 3, robots: int = 2):
        """Give a base with islands around it.

        Parameters
        ----------
        depth
            Islands in the lagoon.
        robots
            Team size.
        """
        graph = nx.DiGraph(name="lagoon", title="A lagoon", base=0, robots=robots)
        graph.add_node(0, reward=0, pos=[0, 0])
        for node in range(1, depth + 1):
            graph.add_node(node, reward=node, pos=[node, node % 2])
            graph.add_edge(0, node, survival=0.9)
            graph.add_edge(node, 0, survival=1)
        return Mission(graph)
'''


class Ended(NamedTuple):
    status: int
    out: str
    err: str


def write_wheel(folder, package, modules, entry_points):
    """Write the wheel of a package that is some modules; give its path."""
    name = package.replace("-", "_")
    info = f"{name}-1.2.dist-info"
    files = {f"{module}.py": textwrap.dedent(code) for module, code in modules.items()}
    files |= {
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.2\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: by hand\nRoot-Is-Purelib: true\n"
        "Tag: py3-none-any\n",
        f"{info}/entry_points.txt": textwrap.dedent(entry_points),
    }
    rows = [f"{path},sha256={_digest(text)},{len(text.encode())}\n" for path, text in files.items()]
    files[f"{info}/RECORD"] = "".join([*rows, f"{info}/RECORD,,\n"])
    wheel = folder / f"{name}-1.2-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        for path, text in files.items():
            archive.writestr(path, text)
    return wheel


def _digest(text):
    digest = hashlib.sha256(text.encode()).digest()
    return base64.urlsafe_b64encode(digest).decode().rstrip("=")


def pip_install(site, *wheels):
    """Install wheels into a folder, as users would, but from no index."""
    arguments = ["install", "--no-index", "--no-deps", "--no-compile", "--target", str(site)]
    subprocess.run(
        [sys.executable, "-m", "pip", "--disable-pip-version-check", *arguments, *map(str, wheels)],
        check=True,
        capture_output=True,
    )


def search_path(site):
    """Put a folder before those that Python looks for modules in anyway."""
    return os.pathsep.join(filter(None, [str(site), os.environ.get("PYTHONPATH")]))


run_anew = functools.partial(subprocess.run, capture_output=True, text=True)


def botohe(*args, site=None, cwd=None, run=run_forked):
    """Run the command in a process of its own that sees what is installed in ``site``.

    With ``run_anew`` it is started as a user would, and loads everything anew.
    """
    path = {"PYTHONPATH": search_path(site)} if site is not None else {}
    done = run([BOTOHE, *map(str, args)], cwd=cwd, env={**os.environ, **path}, timeout=200)
    return Ended(done.returncode, done.stdout, done.stderr)


@pytest.fixture(scope="session")
def third_party_site(tmp_path_factory):
    """A folder into which pip has installed ``botohe-divers``: ``diver`` and ``lagoon``.

    Processes see it with ``PYTHONPATH``; who removes anything works on a copy. Tests of studies
    use this fixture, too.
    """
    folder = tmp_path_factory.mktemp("third_party")
    entry_points = """
        [botohe_moo.algorithms]
        diver = botohe_divers:Diver

        [botohe_moo.missions]
        lagoon = botohe_divers:lagoon
    """
    wheel = write_wheel(folder, "botohe-divers", {"botohe_divers": DIVERS}, entry_points)
    pip_install(folder / "site", wheel)
    return folder / "site"


@pytest.fixture(scope="module")
def broken_site(tmp_path_factory, third_party_site):
    """The same, and packages that are broken."""
    folder = tmp_path_factory.mktemp("broken")
    shutil.copytree(third_party_site, folder / "site")
    wheels = [
        write_wheel(folder, name, {name.replace("-", "_"): code}, entry_points)
        for name, code, entry_points in (
            (
                "botohe-wreck",
                "import no_such_dependency",
                "[botohe_moo.algorithms]\nwreck = botohe_wreck:Wreck\n"
                "[botohe_moo.missions]\nwreck = botohe_wreck:wreck\n",
            ),
            (
                "botohe-quitter",
                "raise SystemExit(7)",
                "[botohe_moo.algorithms]\nquit = botohe_quitter:X\n",
            ),
        )
    ]
    pip_install(folder / "site", *wheels)
    return folder / "site"


@pytest.mark.slow
class TestInstalled:
    def test_they_are_listed_beside_ours(self, third_party_site):
        ended = botohe("algorithms", site=third_party_site, run=run_anew)
        assert (ended.status, ended.err) == (0, "")
        assert re.search(r"^diver +Dive at random, and keep what is best\.$", ended.out, re.M)
        assert re.search(r"^bo-aco +\w", ended.out, re.M)
        ended = botohe("missions", site=third_party_site)
        assert (ended.status, ended.err) == (0, "")
        assert re.search(r"^lagoon +Give a base with islands around it\.$", ended.out, re.M)

    def test_their_algorithm_solves_their_mission(self, third_party_site, tmp_path):
        given = ["-p", "breath=0.9", "-p", "n_dives=10", "-m", "depth=2", "-n", 200, "-o", "out"]
        ended = botohe(
            "solve", "lagoon", "-a", "diver", *given,
            site=third_party_site, cwd=tmp_path, run=run_anew,
        )  # fmt: skip
        assert (ended.status, ended.err) == (0, "")
        with (tmp_path / "out" / "front.csv").open(newline="") as file:
            rows = [(float(row["reward"]), float(row["survivors"])) for row in csv.DictReader(file)]
        # Reckoned by hand: rewards 1 and 2, each way out survived with 0.9, two robots.
        assert rows[0] == pytest.approx((2.7, 1.8))  # one robot to each island
        assert rows[-1] == pytest.approx((0, 2))
        assert any(row == pytest.approx((1.8, 1.9)) for row in rows)  # one robot to the richer

    @pytest.mark.parametrize(
        ("given", "message"),
        [
            (
                ["-a", "diver", "-p", "breath=deep", "-p", "n_dives=0"],
                "Algorithm 'diver': Expected n_dives in [1, 100], got 0. "
                "Expected breath to be a number > 0, got 'deep'.",
            ),
            (["-m", "depth=60"], "Mission 'lagoon': Expected depth in [1, 50], got 60."),
        ],
    )
    def test_what_they_state_is_checked(self, third_party_site, tmp_path, given, message):
        ended = botohe("solve", "lagoon", *given, site=third_party_site, cwd=tmp_path)
        assert ended == Ended(2, "", f"botohe: {message}\n")
        assert list(tmp_path.iterdir()) == []

    def test_without_them_their_names_are_unknown(self, third_party_site, tmp_path):
        site = tmp_path / "site"
        shutil.copytree(third_party_site, site)
        assert botohe("missions", "show", "lagoon", site=site).status == 0
        shutil.rmtree(site)
        for kind, args in (
            ("algorithm", ["solve", "toy", "-a", "diver"]),
            ("algorithm", ["algorithms", "diver"]),
            ("mission", ["solve", "lagoon"]),
        ):
            ended = botohe(*args, site=site, cwd=tmp_path)
            name = "lagoon" if kind == "mission" else "diver"
            begin = f"botohe: {kind.capitalize()} '{name}': there is no such {kind}; known are "
            assert (ended.status, ended.out) == (2, "")
            assert ended.err.startswith(begin)
            assert "; a package that registers it may not be installed" in ended.err


@pytest.mark.slow
class TestBroken:
    def test_they_are_named_and_left_out(self, broken_site):
        ended = botohe("algorithms", site=broken_site)
        assert ended.status == 0
        names = [line.split()[0] for line in ended.out.splitlines() if line]
        assert {"diver", "bo-aco"} <= set(names)
        assert not {"wreck", "quit"} & set(names)
        assert ended.err.splitlines() == [
            "botohe: Algorithm 'quit': botohe_quitter:X of package botohe-quitter cannot be "
            "imported (SystemExit: 7); it is left out.",
            "botohe: Algorithm 'wreck': botohe_wreck:Wreck of package botohe-wreck cannot be "
            "imported (ModuleNotFoundError: No module named 'no_such_dependency'); it is left out.",
        ]


STUDY = """\
name: lagoons
missions:
  lagoon: {mission: lagoon, parameters: {depth: 5}}
algorithms:
  divers: {algorithm: diver, parameters: {breath: 0.5, n_dives: 7}}
  ants: bo-aco
budget: {evaluations: 100}
seeds: 2
"""


@pytest.fixture(scope="module")
def studied(third_party_site, tmp_path_factory):
    """A folder in which the study has run, and the site it ran with."""
    folder = tmp_path_factory.mktemp("study")
    site = folder / "site"
    shutil.copytree(third_party_site, site)
    (folder / "lagoons.yaml").write_text(STUDY)
    ended = botohe("study", "run", "lagoons.yaml", site=site, cwd=folder)
    assert ended.status == 0, ended.err
    return folder, site


@pytest.mark.slow
class TestStudies:
    def test_both_are_in_the_study(self, studied):
        tables = read_study(studied[0] / "results" / "lagoons")
        runs = tables.runs[tables.runs["algorithm"] == "divers"]
        assert runs["status"].tolist() == ["done", "done"]
        # 100 is no multiple of 7: who knows only pymoo's own budgets would spend 105.
        assert runs["evaluations"].tolist() == [100, 100]
        assert len(tables.mission("lagoon").nodes) == 6
        entry = tables.manifest["algorithms"]["divers"]
        assert (entry["package"], entry["version"]) == ("botohe-divers", "1.2")

    def test_and_in_its_report(self, studied):
        folder, site = studied
        ended = botohe("study", "report", "results/lagoons", site=site, cwd=folder)
        assert ended.status == 0, ended.err
        page = (folder / "results" / "lagoons" / "report" / "report.html").read_text()
        assert "divers" in page
        assert "lagoon" in page

    def test_once_it_is_removed_the_study_says_so(self, studied):
        folder, site = studied
        away = site.rename(folder / "away")
        try:
            ended = botohe("study", "run", "lagoons.yaml", site=site, cwd=folder)
        finally:
            away.rename(site)
        assert (ended.status, ended.out) == (2, "")
        lines = ended.err.splitlines()
        assert any("'diver': there is no such algorithm" in line for line in lines)
        assert any("'lagoon': there is no such mission" in line for line in lines)
        # What is there can still be read and reported.
        ended = botohe("study", "report", "results/lagoons", site=site, cwd=folder)
        assert ended.status == 0, ended.err
