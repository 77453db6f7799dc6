"""Packages of others that are broken, or gone: from ``pip install`` to the command line.

The packages are wheels made by hand, so that pip needs neither a build backend nor a network, and
are installed by pip into a folder of their own, as ``pip install --target`` does. What those of the
guides do is in ``tests/docs/test_examples.py``.
"""

import functools
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

DIVERS = '''
    from botohe_moo import BOACO, Mission, load_mission

    def diver(*, n_dives: int = 7) -> BOACO:
        """Dive at random."""
        return BOACO(n_ants=n_dives)

    def lagoon() -> Mission:
        """Give a small place."""
        return load_mission("toy")
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
    files[f"{info}/RECORD"] = "".join(f"{path},,\n" for path in (*files, f"{info}/RECORD"))
    wheel = folder / f"{name}-1.2-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        for path, text in files.items():
            archive.writestr(path, text)
    return wheel


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
    named = "[botohe_moo.algorithms]\ndiver = botohe_divers:diver\n"
    named += "[botohe_moo.missions]\nlagoon = botohe_divers:lagoon\n"
    wheels = [write_wheel(folder, "botohe-divers", {"botohe_divers": DIVERS}, named)]
    for package, (code, entry) in BROKEN.items():
        modules = {package.replace("-", "_"): code}
        wheels.append(write_wheel(folder, package, modules, f"[botohe_moo.algorithms]\n{entry}\n"))
    pip_install(folder / "site", *wheels)
    return folder / "site"


STUDY = """\
{name: lagoons, missions: [lagoon], algorithms: [diver], budget: {evaluations: 20}, seeds: 1}
"""


@pytest.mark.slow
def test_broken_ones_are_named_and_left_out_and_a_study_says_what_is_gone(site, tmp_path):
    ended = botohe("algorithms", site=site, run=run_anew)
    assert ended.status == 0
    assert re.search(r"^diver +Dive at random\.$", ended.out, re.M)
    assert re.search(r"^bo-aco +\w", ended.out, re.M)
    assert not re.search(r"^(wreck|quit) ", ended.out, re.M)
    quitter, wreck = ended.err.splitlines()
    assert quitter.startswith("botohe: Algorithm 'quit': botohe_quitter:X of package botohe-quit")
    assert "(SystemExit: 7); it is left out" in quitter
    assert "'wreck'" in wreck
    assert "No module named 'no_such_dependency'" in wreck
    (tmp_path / "lagoons.yaml").write_text(STUDY)
    ended = botohe("study", "run", "lagoons.yaml", site=site, cwd=tmp_path)
    assert ended.status == 0, ended.err
    tables = read_study(tmp_path / "results" / "lagoons")
    assert tables.runs["status"].tolist() == ["done"]
    entry = tables.manifest["algorithms"]["diver"]
    assert (entry["package"], entry["version"]) == ("botohe-divers", "1.2")
    # Without the package:
    ended = botohe("study", "run", "lagoons.yaml", cwd=tmp_path)
    assert (ended.status, ended.out) == (2, "")
    assert "'diver': no such algorithm" in ended.err
    assert "'lagoon': no such mission" in ended.err
    # What is there can still be read and reported.
    ended = botohe("study", "report", "results/lagoons", cwd=tmp_path)
    assert ended.status == 0, ended.err
