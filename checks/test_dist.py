"""What ``make dist`` has built: what is in it, and whether it works where it is installed.

The wheel is installed into a new environment outside of the checkout, together with the packages of
two guides, and used there as users would: under usual circumstances, where the installation is
read-only, where there is no home folder, and where both is so. Kernels are compiled anew in some of
them, so this takes minutes.
"""

import csv
import email
import json
import os
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path
from typing import NamedTuple

import pytest
from packaging.metadata import Metadata
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
PROJECT = PYPROJECT["project"]
STEM = f"botohe_moo-{PROJECT['version']}"
WHEEL = ROOT / "dist" / f"{STEM}-py3-none-any.whl"
SDIST = ROOT / "dist" / f"{STEM}.tar.gz"
LIBRARY = ROOT / "results" / "library"
PLUG_INS = ("botohe-drift", "botohe-tower")

pytestmark = pytest.mark.timeout(900)


def run(*command, cwd, env=None, check=True):
    done = subprocess.run(
        list(map(str, command)), cwd=cwd, env=env, capture_output=True, text=True, check=False
    )
    assert not check or done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    return done


def build_wheel(source, folder):
    """Build a wheel as ``make dist`` does, without asking an index for the backend."""
    given = ("-m", "build", "--wheel", "--no-isolation", "--outdir", folder, source)
    run(sys.executable, *given, cwd=folder)
    (wheel,) = folder.glob("*.whl")
    return wheel


def asked(wish):
    """Return name and versions of a requirement: indexes know names in one spelling."""
    return canonicalize_name(wish.name), wish.specifier


def contents(wheel):
    with zipfile.ZipFile(wheel) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


class TestContents:
    def test_the_wheel_holds_the_package_and_nothing_else(self):
        source = ROOT / "src"
        files = {
            str(path.relative_to(source))
            for path in (source / "botohe_moo").rglob("*")
            if path.is_file() and "__pycache__" not in path.parts
        }
        assert {"botohe_moo/py.typed", "botohe_moo/mission/data/toy.json"} <= files
        files |= {f"botohe_moo/mission/data/library/{path.name}" for path in LIBRARY.iterdir()}
        info = f"{STEM}.dist-info/"
        packed = contents(WHEEL)
        assert {name for name in packed if not name.startswith(info)} == files
        assert {name.removeprefix(info) for name in packed if name.startswith(info)} == {
            "METADATA", "RECORD", "WHEEL", "entry_points.txt", "licenses/LICENSE",
            "licenses/src/botohe_moo/explorer/vendor/LICENSE",
        }  # fmt: skip

    def test_the_sdist_holds_what_is_committed(self):
        with tarfile.open(SDIST) as archive:
            packed = {name.removeprefix(f"{STEM}/") for name in archive.getnames()}
        assert {"PKG-INFO", "Makefile", "constraints.txt", "tests/conftest.py"} <= packed
        assert {"paper/paper.md", "paper/paper.bib", "packaging/recipe.yaml"} <= packed
        assert {f"results/library/{path.name}" for path in LIBRARY.iterdir()} <= packed
        if not (ROOT / ".git").exists():
            pytest.skip("What is committed is known in a checkout only.")
        committed = run("git", "ls-files", "-z", cwd=ROOT).stdout.split("\0")
        assert packed == {*filter(None, committed), "PKG-INFO"}

    def test_the_sdist_builds_the_wheel_of_the_checkout(self, tmp_path):
        with tarfile.open(SDIST) as archive:
            archive.extractall(tmp_path, filter="data")
        for name in ("of-checkout", "of-sdist"):
            (tmp_path / name).mkdir()
        of_checkout = contents(build_wheel(ROOT, tmp_path / "of-checkout"))
        assert contents(build_wheel(tmp_path / STEM, tmp_path / "of-sdist")) == of_checkout
        assert contents(WHEEL) == of_checkout

    def test_metadata_are_valid_and_those_of_the_project(self):
        raw = contents(WHEEL)[f"{STEM}.dist-info/METADATA"]
        metadata = Metadata.from_email(raw, validate=True)
        assert (metadata.name, str(metadata.version)) == (PROJECT["name"], PROJECT["version"])
        assert str(metadata.requires_python) == PROJECT["requires-python"]
        wishes = [wish for wish in metadata.requires_dist if wish.marker is None]
        assert set(map(asked, wishes)) == set(map(asked, map(Requirement, PROJECT["dependencies"])))
        assert email.message_from_bytes(raw).get_payload().startswith("# ")  # the README


class Installed(NamedTuple):
    bin: Path
    site: Path

    def files(self):
        return {str(path.relative_to(self.site)) for path in self.site.rglob("*")}


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A new environment outside of the checkout, into which pip has installed the wheels."""
    folder = tmp_path_factory.mktemp("installed")
    assert ROOT not in folder.parents
    wheels = [WHEEL]
    for name in PLUG_INS:
        (folder / name).mkdir()
        source = ROOT / "docs" / "examples" / name
        wheels.append(build_wheel(source, folder / name))
    run(sys.executable, "-m", "venv", folder / "venv", cwd=folder)
    python = folder / "venv" / "bin" / "python"
    given = ("--quiet", "--constraint", ROOT / "constraints.txt", *wheels)
    run(python, "-m", "pip", "install", *given, cwd=folder, env=outside())
    where = "import botohe_moo, pathlib; print(pathlib.Path(botohe_moo.__file__).parents[1])"
    site = Path(run(python, "-c", where, cwd=folder, env=outside()).stdout.strip())
    assert site.is_relative_to(folder / "venv")
    for compiled in (site / "botohe_moo").rglob("*.nb[ci]"):
        compiled.unlink()
    return Installed(python.parent, site)


def outside(**more):
    """Return the environment without the options of this interpreter."""
    ours = re.compile(r"PYTHON|NUMBA_|VIRTUAL_ENV|XDG_|MPLCONFIGDIR|BOTOHE_")
    return {name: text for name, text in os.environ.items() if not ours.match(name)} | more


class TestInstallation:
    def test_it_is_complete(self, installed, tmp_path):
        run(installed.bin / "python", "-m", "pip", "check", cwd=tmp_path, env=outside())
        said = run(installed.bin / "botohe", "--version", cwd=tmp_path, env=outside()).stdout
        assert said == f"botohe-moo {PROJECT['version']}\n"

    def test_entry_points_are_found(self, installed, tmp_path):
        for kind, theirs in (("algorithms", "drift"), ("missions", "tower")):
            ended = run(installed.bin / "botohe", kind, cwd=tmp_path, env=outside())
            names = {line.split()[0] for line in ended.stdout.splitlines() if line}
            assert {*PROJECT["entry-points"][f"botohe_moo.{kind}"], theirs} <= names
            assert ended.stderr == ""

    def test_type_checkers_see_its_types(self, installed, tmp_path):
        code = "from botohe_moo import load_mission\nreveal_type(load_mission('toy').robots)\n"
        (tmp_path / "use.py").write_text(code)
        given = ("--strict", "--cache-dir", os.devnull, "use.py")
        python = ("--python-executable", installed.bin / "python")
        ended = run(sys.executable, "-m", "mypy", *python, *given, cwd=tmp_path, env=outside())
        assert 'Revealed type is "int"' in ended.stdout.replace("builtins.int", "int")


STUDY = """\
name: small
missions: {museum: art_museum, tower: {mission: tower, parameters: {floors: 2, rooms: 2}}}
algorithms: {drift: drift, ants: bo-aco, random: random}
budget: {evaluations: 300}
seeds: 2
comparison: {control: random}
"""


@pytest.fixture(scope="module")
def fronts():
    """The fronts that were found under the circumstances so far: all have to be the same."""
    return set()


def bound_by_rights():
    """What to put before a command to let permissions bind it: root may write everywhere."""
    if os.geteuid() != 0:
        return []
    return ["setpriv", "--bounding-set=-dac_override", "--inh-caps=-dac_override"]


def as_nobody_known():
    """What to put before a command to run it as a user whom the system does not know.

    They may read everything, for the interpreter may stand in root's home.
    """
    user = ["setpriv", "--reuid=54321", "--regid=54321", "--clear-groups"]
    return [*user, "--inh-caps=+dac_read_search", "--ambient-caps=+dac_read_search"]


def use(installed, folder, prefix, env):
    """Solve, run a study with a plug-in's algorithm and mission, and report it; give the front."""
    (folder / "small.yaml").write_text(STUDY)
    botohe = [*prefix, installed.bin / "botohe"]
    solve = ("solve", "art_museum", "--evaluations", 500, "--seed", 1, "--out", "found")
    for command in (solve, ("study", "run", "small.yaml"), ("study", "report", "results/small")):
        ended = run(*botohe, *command, cwd=folder, env=env)
        assert "Traceback" not in ended.stderr
        assert "rror" not in ended.stderr
    manifest = json.loads((folder / "results" / "small" / "study.json").read_text())
    assert manifest["algorithms"]["drift"]["package"] == "botohe-drift"
    with (folder / "results" / "small" / "summary.csv").open(newline="") as file:
        rows = {(row["mission"], row["algorithm"]): row["n"] for row in csv.DictReader(file)}
    assert rows == {(m, a): "2" for m in ("museum", "tower") for a in ("drift", "ants", "random")}
    assert "tower" in (folder / "results" / "small" / "report" / "report.html").read_text("utf-8")
    assert {path.name for path in folder.iterdir()} == {"found", "results", "small.yaml"}
    return (folder / "found" / "front.csv").read_text()


def compiled(folder):
    return sorted(folder.rglob("*.nbi"))


@pytest.fixture
def read_only(installed):
    """Take everybody's right to write to the installation, and see that nobody has."""
    folders = [installed.site, *(path for path in installed.site.rglob("*") if path.is_dir())]
    for folder in folders:
        folder.chmod(folder.stat().st_mode & ~0o222)
    before = installed.files()
    place = installed.site / "botohe_moo"
    ended = run(*bound_by_rights(), "touch", "probe", cwd=place, check=False)
    assert "Permission denied" in ended.stderr, "the installation can be written to"
    yield
    after = installed.files()
    for folder in folders:
        folder.chmod(folder.stat().st_mode | 0o200)
    assert after == before


# A folder that nobody can make: there is a device in its place.
NO_HOME = f"{os.devnull}/home"


class TestUse:
    """In the order given: the last leaves compiled kernels in the installation."""

    def test_read_only(self, installed, read_only, fronts, tmp_path):
        (work := tmp_path / "work").mkdir()
        (home := tmp_path / "home").mkdir()
        env = outside(HOME=str(home))
        fronts.add(use(installed, work, bound_by_rights(), env))
        assert compiled(home)
        assert not compiled(installed.site)

    def test_read_only_and_no_home(self, installed, read_only, fronts, tmp_path):
        fronts.add(use(installed, tmp_path, bound_by_rights(), outside(HOME=NO_HOME)))
        assert not compiled(installed.site)
        assert len(fronts) == 1

    @pytest.mark.skipif(os.geteuid() != 0, reason="Only root may be somebody else.")
    def test_a_user_whom_the_system_does_not_know(self, installed, fronts, tmp_path):
        for folder in tmp_path.parents:
            if folder.stat().st_uid == os.geteuid() and folder.name.startswith("pytest-"):
                folder.chmod(0o755)
        tmp_path.chmod(0o777)
        env = outside()
        del env["HOME"]
        fronts.add(use(installed, tmp_path, as_nobody_known(), env))
        assert not compiled(installed.site)
        assert len(fronts) == 1

    def test_no_home(self, installed, fronts, tmp_path):
        env = outside()
        fronts.add(use(installed, tmp_path, [], env | {"HOME": NO_HOME}))
        assert compiled(installed.site)
        assert len(fronts) == 1

    def test_as_usual(self, installed, fronts, tmp_path):
        (work := tmp_path / "work").mkdir()
        (home := tmp_path / "home").mkdir()
        fronts.add(use(installed, work, [], outside(HOME=str(home))))
        assert not compiled(home)
        assert len(fronts) == 1


class TestLibrary:
    """After the tests of use: kernels are compiled by then."""

    def test_best_known_fronts_come_with_the_package(self, installed, tmp_path):
        folder = installed.site / "botohe_moo" / "mission" / "data" / "library"
        there = {path.name: path.read_bytes() for path in folder.iterdir()}
        assert there == {path.name: path.read_bytes() for path in LIBRARY.iterdir()}
        code = "from botohe_moo.library import best_known; best_known('town-16').check()"
        run(installed.bin / "python", "-c", code, cwd=tmp_path, env=outside())

    def test_the_command_checks_them(self, installed, tmp_path):
        given = ("library", "check", "town-16")
        said = run(installed.bin / "botohe", *given, cwd=tmp_path, env=outside()).stdout
        assert said.startswith("town-16: right\n")
