"""Algorithms and missions of other packages, from ``pip install`` to the command line and back.

The packages are wheels made by hand, so that pip needs neither a build backend nor a network, and
are installed by pip into a folder of their own, as ``pip install --target`` does. What those of the
guides do is in ``tests/docs/test_examples.py``.
"""

import base64
import functools
import hashlib
import os
import re
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
        """Dive at random, and keep what is best."""

        def __init__(self, *, n_dives: Annotated[int, Field(ge=1, le=100)] = 7, **options):
            super().__init__(**options)
            self.n_dives = n_dives

        def _infill(self):
            mission, plans = self.problem.mission, np.empty((self.n_dives, 1), object)
            for i in range(self.n_dives):
                islands = self.random_state.integers(1, len(mission.nodes), mission.robots)
                plans[i, 0] = mission.plan([[0, int(island), 0] for island in islands])
            return Population.new("X", plans)

        _initialize_infill = _infill

        def _initialize_advance(self, infills=None, **kwargs):
            self._advance(infills, **kwargs)

        def _advance(self, infills=None, **kwargs):
            self.pop = infills if self.pop is None else Population.merge(self.pop, infills)


    def lagoon(*, depth: Annotated[int, Field(ge=1, le=50)] = 3, robots: int = 2):
        """Give a base with islands around it."""
        graph = nx.DiGraph(name="lagoon", base=0, robots=robots)
        graph.add_node(0, reward=0)
        for node in range(1, depth + 1):
            graph.add_node(node, reward=node)
            graph.add_edge(0, node, survival=0.9)
            graph.add_edge(node, 0, survival=1)
        return Mission(graph)
'''

# Packages that cannot be imported, with the name and the module of their entry.
BROKEN = {
    "botohe-wreck": ("import no_such_dependency", "wreck = botohe_wreck:Wreck"),
    "botohe-quitter": ("raise SystemExit(7)", "quit = botohe_quitter:X"),
}


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


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder into which pip has installed ``diver``, ``lagoon``, and what is broken."""
    folder = tmp_path_factory.mktemp("third_party")
    entry_points = """
        [botohe_moo.algorithms]
        diver = botohe_divers:Diver

        [botohe_moo.missions]
        lagoon = botohe_divers:lagoon
    """
    wheels = [write_wheel(folder, "botohe-divers", {"botohe_divers": DIVERS}, entry_points)]
    for package, (code, entry) in BROKEN.items():
        modules = {package.replace("-", "_"): code}
        wheels.append(write_wheel(folder, package, modules, f"[botohe_moo.algorithms]\n{entry}\n"))
    pip_install(folder / "site", *wheels)
    return folder / "site"


STUDY = """\
name: lagoons
missions:
  lagoon: {mission: lagoon, parameters: {depth: 2}}
algorithms:
  divers: {algorithm: diver, parameters: {n_dives: 7}}
  ants: bo-aco
budget: {evaluations: 100}
seeds: 2
"""


@pytest.mark.slow
def test_they_are_listed_beside_ours_and_broken_ones_are_named_and_left_out(site):
    ended = botohe("algorithms", site=site, run=run_anew)
    assert ended.status == 0
    assert re.search(r"^diver +Dive at random, and keep what is best\.$", ended.out, re.M)
    assert re.search(r"^bo-aco +\w", ended.out, re.M)
    assert not re.search(r"^(wreck|quit) ", ended.out, re.M)
    quitter, wreck = ended.err.splitlines()
    assert quitter.startswith(
        "botohe: Algorithm 'quit': botohe_quitter:X of package botohe-quitter"
    )
    assert "(SystemExit: 7); it is left out" in quitter
    assert "'wreck'" in wreck
    assert "No module named 'no_such_dependency'" in wreck
    ended = botohe("missions", site=site)
    assert (ended.status, ended.err) == (0, "")
    assert re.search(r"^lagoon +Give a base with islands around it\.$", ended.out, re.M)


@pytest.mark.slow
def test_what_they_state_is_checked(site, tmp_path):
    for given, message in (
        (["-a", "diver", "-p", "n_dives=0"], "'diver': Expected n_dives in [1, 100], got 0."),
        (["-m", "depth=60"], "'lagoon': Expected depth in [1, 50], got 60."),
    ):
        ended = botohe("solve", "lagoon", *given, site=site, cwd=tmp_path)
        assert (ended.status, ended.out) == (2, "")
        assert ended.err.endswith(f"{message}\n")
        assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_they_are_studied_and_once_they_are_removed_the_study_says_so(site, tmp_path):
    (tmp_path / "lagoons.yaml").write_text(STUDY)
    ended = botohe("study", "run", "lagoons.yaml", site=site, cwd=tmp_path)
    assert ended.status == 0, ended.err
    tables = read_study(tmp_path / "results" / "lagoons")
    runs = tables.runs[tables.runs["algorithm"] == "divers"]
    assert runs["status"].tolist() == ["done", "done"]
    # 100 is no multiple of 7: who knows only pymoo's own budgets would spend 105.
    assert runs["evaluations"].tolist() == [100, 100]
    entry = tables.manifest["algorithms"]["divers"]
    assert (entry["package"], entry["version"]) == ("botohe-divers", "1.2")
    # Reckoned by hand: a robot to each island, of reward 1 and 2, survives the way out with 0.9.
    fronts = tables.plans[tables.plans["run"].isin(runs.index)]
    assert fronts["reward"].to_numpy() == pytest.approx(2.7)
    assert fronts["survivors"].to_numpy() == pytest.approx(1.8)
    # Without the package:
    ended = botohe("study", "run", "lagoons.yaml", cwd=tmp_path)
    assert (ended.status, ended.out) == (2, "")
    assert "'diver': no such algorithm" in ended.err
    assert "'lagoon': no such mission" in ended.err
    # What is there can still be read and reported.
    ended = botohe("study", "report", "results/lagoons", cwd=tmp_path)
    assert ended.status == 0, ended.err
