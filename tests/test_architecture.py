"""What holds for the source as a whole: who imports whom, what is documented, what is forbidden.

Every rule is a function from source to a list of faults; each is shown to find what it looks for
before it is applied to the package.
"""

import ast
import functools
import importlib
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import networkx as nx
import pytest

import botohe_moo
from botohe_moo import algorithms, decide, explorer, mission, operators, outcomes, plots, study

PACKAGE = Path(botohe_moo.__file__).parent
SOURCES = sorted(PACKAGE.rglob("*.py"))

# Section 4 of the design: each entry may import those before it. Private modules stand where
# they are used first.
ORDER = [
    "_base",
    "_plugins",
    "kernels",
    "trails",
    "mission",
    "outcomes",
    "indicators",
    "search",
    "problem",
    "operators",
    "algorithms",
    "decide",
    "plots",
    "explorer",
    "solution",
    "solving",
    "testing",
    "study",
    "cli",
]

# Within some entries, rooms have an order, too.
ROOMS = {
    "plots": [
        "draw",
        "front",
        "mission",
        "pheromone",
        "plan",
        "outcomes",
        "study",
        "choices",
        "case_study",
    ],
    "study": [
        "file",
        "run",
        "store",
        "judge",
        "report",
        "planning",
        "estimate",
        "merge",
        "runner",
    ],
}

KERNELS_MAY_IMPORT = re.compile(
    r"(__future__|collections\.abc|functools|gc|heapq|math|numba|os|numpy|pathlib|typing|botohe_moo\.(_base\.(compiling|types)|kernels))(\.|$)"
)


def module_name(path):
    parts = ["botohe_moo", *path.relative_to(PACKAGE).with_suffix("").parts]
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@functools.cache  # a dozen rules look at each
def parsed(path):
    return ast.parse(path.read_text("utf-8"))


def imported(tree):
    """Everything that is imported anywhere, also in functions and for type checkers only."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (f"{'.' * node.level}{node.module or ''}.{a.name}" for a in node.names)


def entry_of(module):
    return module.split(".")[1]


def import_faults(module, tree):
    faults = []
    for name in imported(tree):
        if name.startswith("."):
            faults.append(f"{module} imports {name}: relative")
        elif name.split(".")[0] == "botohe_moo":
            entry = entry_of(f"{name}.")
            if entry not in ORDER:
                faults.append(f"{module} imports {name}, which is no entry")
            elif entry != entry_of(module) and ORDER.index(entry) >= ORDER.index(entry_of(module)):
                faults.append(f"{module} imports {name}, which stands below it")
    return faults


def room_faults(module, tree):
    """Imports within an entry whose rooms have an order, that do not follow it."""
    _, entry, room, *_ = f"{module}...".split(".")
    rooms = ROOMS.get(entry, [])
    if room not in rooms:
        return []
    faults = []
    for name in imported(tree):
        package, other, below, *_ = f"{name}...".split(".")
        if (package, other) == ("botohe_moo", entry) and below != room:
            if below not in rooms:
                faults.append(f"{module} imports {name}, which is in no room")
            elif rooms.index(below) > rooms.index(room):
                faults.append(f"{module} imports {name}, whose room stands below it")
    return faults


def kernel_faults(tree):
    return [name for name in imported(tree) if not KERNELS_MAY_IMPORT.match(name)]


def pymoo_faults(module, tree):
    """Imports of pymoo by what stands above the problem."""
    if ORDER.index(entry_of(module)) >= ORDER.index("problem"):
        return []
    return [name for name in imported(tree) if name.split(".")[0] == "pymoo"]


LAZY_NAMES = "__getattr__, __dir__, __all__ = lazy_names(__name__)"
ALSO_MOVED = LAZY_NAMES.replace("__name__", "__name__, _MOVED")
LAZY = {ast.dump(ast.parse(line).body[0]) for line in (LAZY_NAMES, ALSO_MOVED)}


def initialiser_faults(tree):
    """What an ``__init__`` does besides importing and naming what it exports."""
    faults = []
    for node in tree.body:
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            faults += initialiser_faults(ast.Module([*node.body, *node.orelse], []))
        elif isinstance(node, ast.Assign):
            named = [ast.unparse(target) for target in node.targets]
            if ast.dump(node) not in LAZY and named not in (["__all__"], ["_MOVED"]):
                faults.append(f"assigns {named}")
        elif not (
            isinstance(node, ast.Import | ast.ImportFrom)
            or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant))
        ):
            faults.append(ast.unparse(node))
    return faults


def dotted(node):
    """``np.random.rand`` for the expression of that name; empty for other expressions."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute) and (owner := dotted(node.value)):
        return f"{owner}.{node.attr}"
    return ""


def spoken_of(tree):
    """Every name that is imported, and every dotted name that is used."""
    yield from imported(tree)
    yield from filter(None, map(dotted, ast.walk(tree)))


SHARED_GENERATOR = re.compile(
    r"(np|numpy)\.random\.(?!(default_rng|BitGenerator|Generator|PCG64|SeedSequence)\b)"
)
UNSAFE_MODULES = {"cloudpickle", "dill", "joblib", "marshal", "pickle", "runpy", "shelve"}
UNSAFE_YAML = re.compile(
    r"yaml\.(?!((Marked)?YAMLError|SafeDumper|SafeLoader|nodes|safe_dump|safe_load)\b)"
)
UNSAFE_BUILTINS = {"__import__", "compile", "eval", "exec"}
UNSAFE_METHODS = {"read_pickle", "to_pickle"}
SAFE_KEYWORDS = {"allow_pickle=False"}  # which forbids it; a variable may be true


def random_faults(tree):
    """Uses of generators that are shared by everybody."""
    faults = [name for name in imported(tree) if name.split(".")[0] == "random"]
    return faults + [name for name in spoken_of(tree) if SHARED_GENERATOR.match(name)]


def unsafe_faults(tree):
    """Whatever could run what it reads."""
    faults = [name for name in imported(tree) if name.split(".")[0] in UNSAFE_MODULES]
    faults += [name for name in spoken_of(tree) if UNSAFE_YAML.match(name)]
    for node in ast.walk(tree):
        if (
            (isinstance(node, ast.Call) and dotted(node.func) in UNSAFE_BUILTINS)
            or (isinstance(node, ast.Attribute) and node.attr in UNSAFE_METHODS)
            or (
                isinstance(node, ast.keyword)
                and node.arg == "allow_pickle"
                and ast.unparse(node) not in SAFE_KEYWORDS
            )
        ):
            faults.append(ast.unparse(node))
    return faults


def dynamic_faults(tree):
    """Imports that the other rules cannot see."""
    names = {"importlib", "importlib.import_module", "import_module", "__import__"}
    return [name for name in spoken_of(tree) if name in names]


def public_definitions(body, owner=""):
    """Public classes and functions with their dotted names, methods among them."""
    for node in body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield f"{owner}{node.name}", node
            yield from public_definitions(node.body, f"{owner}{node.name}.")
        elif isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            decorators = [dotted(decorator) for decorator in node.decorator_list]
            # Documented with the implementation, and with the getter.
            if not any(d == "overload" or d.endswith((".setter", ".deleter")) for d in decorators):
                yield f"{owner}{node.name}", node


def section(docstring, title):
    """The names that a section of a numpydoc docstring lists; None without the section."""
    found = re.search(
        rf"^{title}\n-+\n(.*?)(?=^[^\n]+\n-{{3,}}\n|\Z)", docstring, re.MULTILINE | re.DOTALL
    )
    if found is None:
        return None
    lines = [line for line in found[1].splitlines() if line[:1].strip()]
    return [name.strip(" *") for line in lines for name in line.split(",")]


def parameters(node):
    """What a function, or the constructor of a class, is given."""
    if isinstance(node, ast.ClassDef):
        inits = [n for n in node.body if isinstance(n, ast.FunctionDef) and n.name == "__init__"]
        return parameters(inits[0]) if inits else []
    given = node.args
    listed = [*given.posonlyargs, *given.args, *given.kwonlyargs, given.vararg, given.kwarg]
    return [arg.arg for arg in listed if arg is not None and arg.arg not in ("self", "cls")]


def fields(node):
    """What the instances of a dataclass or a named tuple hold."""
    declared = [*node.decorator_list, *getattr(node, "bases", [])]
    if not any("dataclass" in ast.unparse(d) or "NamedTuple" in ast.unparse(d) for d in declared):
        return []
    annotated = [n.target.id for n in node.body if isinstance(n, ast.AnnAssign)]
    return [name for name in annotated if not name.startswith("_")]


def docstring_faults(tree, exported=frozenset()):
    """Missing docstrings; parameters that are missing, made up or have types.

    Who only reads the code may do without a Parameters section; what is exported has one.
    """
    faults = [] if ast.get_docstring(tree) else ["the module has no docstring"]
    for name, node in public_definitions(tree.body):
        docstring = ast.get_docstring(node)
        if docstring:
            found = parameter_faults(node, docstring, name.split(".")[0] in exported)
            faults += [f"{name}: {fault}" for fault in found]
        else:
            faults.append(f"{name} has no docstring")
    return faults


def parameter_faults(node, docstring, exported):
    listed = section(docstring, "Parameters")
    described = [name.partition(" ")[0] for name in listed or []]
    given, held = parameters(node), fields(node)
    faults = [f"{name!r} has a type" for name in listed or [] if " " in name]
    faults += [f"there is no {name}" for name in described if name not in (*given, *held)]
    if isinstance(node, ast.ClassDef):  # which may describe as attributes what it is given
        described += section(docstring, "Attributes") or []
        described = [name.partition(" ")[0] for name in described]
    needed = [*given, *held] if exported else given if listed else []
    return faults + [f"{name} is not described" for name in needed if name not in described]


def homes_for_checkers(tree):
    """The names that type checkers take for exported, ``NAME as NAME``, and their modules."""
    return {
        alias.asname: node.module
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.asname == alias.name
    }


def exported_by(tree):
    """The names in ``__all__``, or imported for type checkers as exported."""
    for node in tree.body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            return ast.literal_eval(node.value)
    return [*homes_for_checkers(tree)]


INITIALISERS = [path for path in SOURCES if path.name == "__init__.py"]
TOP = PACKAGE / "__init__.py"
EXPORTED = frozenset(name for path in INITIALISERS for name in exported_by(parsed(path)))


def found_by(rule):
    """What a rule of a module's name and its tree finds, by the modules that have such faults."""
    named = {module_name(path): parsed(path) for path in SOURCES}
    return {module: faults for module, tree in named.items() if (faults := rule(module, tree))}


def below_the_top(rule):
    """The rule without the package itself, which exports from everywhere; nobody imports it."""
    return lambda module, tree: module != "botohe_moo" and rule(module, tree)


class TestImports:
    @pytest.mark.parametrize(
        ("module", "line"),
        [
            ("botohe_moo.trails", "from botohe_moo.mission import Mission"),
            ("botohe_moo.trails", "from botohe_moo import mission"),
            ("botohe_moo.trails", "import botohe_moo.mission.model"),
            ("botohe_moo.mission.model", "def f():\n from botohe_moo.problem import BOTOHE"),
            ("botohe_moo.mission.model", "if TYPE_CHECKING:\n import botohe_moo.problem"),
            ("botohe_moo.algorithms.x", "from botohe_moo import BOTOHE"),
            ("botohe_moo.algorithms.x", "import botohe_moo"),
            ("botohe_moo.algorithms.x", "from .archive import PlanArchive"),
            ("botohe_moo.algorithms.x", "from . import archive"),
            ("botohe_moo._base.types", "from botohe_moo._plugins import Fault"),
        ],
    )
    def test_the_rule_finds(self, module, line):
        assert len(import_faults(module, ast.parse(line))) == 1

    @pytest.mark.parametrize(
        ("module", "line"),
        [
            ("botohe_moo.trails", "import numpy, botohe_moo_extras"),
            ("botohe_moo.trails", "from botohe_moo._base.checks import check_integer"),
            ("botohe_moo.mission.formats.files", "from botohe_moo.mission.model import Mission"),
            ("botohe_moo.cli.app", "def f():\n from botohe_moo import solving"),
        ],
    )
    def test_the_rule_allows(self, module, line):
        assert import_faults(module, ast.parse(line)) == []

    def test_every_entry_has_its_place(self):
        entries = {entry_of(module_name(path)) for path in SOURCES if path != TOP}
        assert entries == set(ORDER)

    def test_they_point_one_way(self):
        assert found_by(below_the_top(import_faults)) == {}

    @pytest.mark.parametrize(
        ("module", "line"),
        [
            ("botohe_moo.study.file.x", "from botohe_moo.study.store import manifest"),
            ("botohe_moo.study.run.x", "def f():\n import botohe_moo.study.store.folder"),
            ("botohe_moo.study.judge.x", "from botohe_moo.study.report import words"),
            ("botohe_moo.study.planning", "from botohe_moo.study.runner import run_study"),
            ("botohe_moo.study.store.x", "from botohe_moo.study import StudyError"),
            ("botohe_moo.plots.draw.x", "from botohe_moo.plots.front import staircase"),
        ],
    )
    def test_the_rule_of_rooms_finds(self, module, line):
        assert len(room_faults(module, ast.parse(line))) == 1

    @pytest.mark.parametrize(
        ("module", "line"),
        [
            ("botohe_moo.study.store.x", "from botohe_moo.study.file.model import Study"),
            ("botohe_moo.study.store.x", "from botohe_moo.study.store.tables import SCHEMAS"),
            ("botohe_moo.study.report.x", "from botohe_moo.plots.draw.style import theme"),
            ("botohe_moo.mission.x", "from botohe_moo.mission.model import Mission"),
        ],
    )
    def test_the_rule_of_rooms_allows(self, module, line):
        assert room_faults(module, ast.parse(line)) == []

    @pytest.mark.parametrize("entry", ROOMS)
    def test_every_room_has_its_place(self, entry):
        found = {path.stem for path in (PACKAGE / entry).iterdir()} - {"__init__", "__pycache__"}
        assert found == set(ROOMS[entry])

    def test_rooms_point_one_way(self):
        assert found_by(room_faults) == {}

    def test_no_module_imports_itself_through_others(self):
        modules = {module_name(path): parsed(path) for path in SOURCES if path != TOP}
        graph = nx.DiGraph()
        for module, tree in modules.items():
            for name in imported(tree):
                target = name if name in modules else name.rpartition(".")[0]
                if target in modules:
                    graph.add_edge(module, target)
        assert graph.number_of_edges() > 20
        assert list(nx.simple_cycles(graph)) == []

    def test_kernels_know_arrays_only(self):
        line = "import numpy as np, pandas\nfrom networkx import DiGraph\nfrom numba import njit"
        assert kernel_faults(ast.parse(line)) == ["pandas", "networkx.DiGraph"]
        faults = {p.name: kernel_faults(parsed(p)) for p in (PACKAGE / "kernels").rglob("*.py")}
        assert len(faults) > 5
        assert not any(faults.values()), faults

    def test_engines_know_nothing_of_pymoo(self):
        tree = ast.parse("def f():\n from pymoo.core.problem import Problem")
        assert pymoo_faults("botohe_moo.search.colony", tree)
        assert not pymoo_faults("botohe_moo.algorithms.nsga2", tree)
        assert found_by(below_the_top(pymoo_faults)) == {}

    def test_every_room_is_there(self):
        assert [name for name in ORDER if find_spec(f"botohe_moo.{name}") is None] == []

    @pytest.mark.parametrize(
        "line",
        [
            "from importlib import import_module",
            "import importlib\nimportlib.import_module('x')",
            "__import__('x')",
        ],
    )
    def test_hidden_imports_are_found(self, line):
        assert dynamic_faults(ast.parse(line))

    def test_one_place_imports_by_name(self):
        found = found_by(lambda _, tree: dynamic_faults(tree))
        assert found.keys() == {"botohe_moo._base.lazy"}, found


class TestInitialisers:
    @pytest.mark.parametrize(
        "line",
        [
            "x = 1",
            "def f(): ...",
            "class A: ...",
            "register()",
            "def __getattr__(name): ...",
            "__getattr__ = register",
            "if TYPE_CHECKING:\n x = 1",
            "if sys.argv:\n import a",
            "__all__ = []\n__all__ += ['a']",
            "for x in y: z",
        ],
    )
    def test_the_rule_finds(self, line):
        assert initialiser_faults(ast.parse(line))

    def test_what_is_lazy_is_allowed(self):
        lazy = f"if TYPE_CHECKING:\n from a import b as b\n{LAZY_NAMES}"
        assert initialiser_faults(ast.parse(lazy)) == []

    @pytest.mark.parametrize("path", INITIALISERS, ids=module_name)
    def test_they_only_export(self, path):
        assert initialiser_faults(parsed(path)) == []

    @pytest.mark.parametrize("path", INITIALISERS, ids=module_name)
    def test_they_export_what_they_import(self, path):
        tree = parsed(path)
        names = {name.rpartition(".")[2] for name in imported(tree)}
        assert sorted(names - {"TYPE_CHECKING", "lazy_names"}) == sorted(exported_by(tree))


LAZY_PACKAGES = [
    botohe_moo,
    algorithms,
    decide,
    explorer,
    mission,
    operators,
    outcomes,
    plots,
    study,
]
DECIDE = ", ".join(module_name(path) for path in sorted((PACKAGE / "decide").glob("[!_]*.py")))
PUBLIC = [(package, name) for package in LAZY_PACKAGES for name in package.__all__]


class TestLazyNames:
    """They are there, the same for Python and for type checkers, and nobody waits for the rest."""

    @pytest.mark.parametrize("package", LAZY_PACKAGES, ids=lambda package: package.__name__)
    def test_all_lists_what_type_checkers_import(self, package):
        tree = parsed(Path(package.__file__))
        [checked] = [node for node in tree.body if isinstance(node, ast.If)]
        for_checkers = homes_for_checkers(checked)
        assert sorted(for_checkers) == sorted(name.split(".")[-1] for name in imported(checked))
        assert sorted(for_checkers) == package.__all__

    @pytest.mark.parametrize(("package", "name"), PUBLIC)
    def test_each_is_what_its_home_says(self, package, name):
        home = homes_for_checkers(parsed(Path(package.__file__)))[name]
        expected = getattr(importlib.import_module(home), name)
        assert getattr(package, name) is expected
        scope = {}
        exec(f"from {package.__name__} import {name}", scope)
        assert scope[name] is expected

    @pytest.mark.parametrize(("package", "name"), PUBLIC)
    def test_none_has_the_name_of_a_module(self, package, name):
        # Python would put the module in its place as soon as anybody imports it.
        assert find_spec(f"{package.__name__}.{name}") is None

    @pytest.mark.parametrize("package", LAZY_PACKAGES, ids=lambda package: package.__name__)
    def test_they_are_listed(self, package):
        assert set(package.__all__) <= set(dir(package))

    def test_what_was_public_once_can_be_imported(self):
        moved = {name: home for home, names in botohe_moo._MOVED.items() for name in names}
        assert {"PlanBatch", "PlanError", "exact_front"} <= set(moved)
        assert not set(moved) & {*botohe_moo.__all__, *dir(botohe_moo)}
        for name, home in moved.items():
            expected = getattr(importlib.import_module(home, "botohe_moo"), name)
            assert getattr(botohe_moo, name) is expected

    def test_other_names_are_refused(self):
        with pytest.raises(AttributeError, match="'botohe_moo' has no attribute 'Misson'"):
            botohe_moo.Misson  # noqa: B018
        assert not hasattr(botohe_moo, "__wrapped__")

    @pytest.mark.parametrize(
        ("module", "others"),
        [
            ("botohe_moo", "numpy numba pandas pydantic pymoo networkx matplotlib typer"),
            ("botohe_moo.study.run.child", "pandas matplotlib typer"),
            (DECIDE, "pandas pymoo matplotlib typer"),
        ],
    )
    def test_importing_waits_for_nothing_else(self, module, others):
        code = f"import sys, {module}; print(*sorted({{m.split('.')[0] for m in sys.modules}}))"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
        loaded = set(done.stdout.decode().split())
        assert "botohe_moo" in loaded
        assert not loaded & set(others.split())


LISTED = " Parameters\n ----------\n"


class TestDocstrings:
    @pytest.mark.parametrize(
        ("code", "fault"),
        [
            (f"def f(a):\n '''Do.\n\n{LISTED} a : int\n  An a.\n '''", "f: 'a : int' has a type"),
            (f"def f(a, b):\n '''Do.\n\n{LISTED} a\n  An a.\n '''", "f: b is not described"),
            (f"def f(*a):\n '''Do.\n\n{LISTED} *a, b\n  An a.\n '''", "f: there is no b"),
            ("def f(a): ...", "f has no docstring"),
            ("class A:\n '''A.'''\n def f(self): ...", "A.f has no docstring"),
            ("class A: ...", "A has no docstring"),
            ("def shown(a):\n '''Do.'''", "shown: a is not described"),
            (
                "class shown:\n '''A.'''\n def f(self, a):\n  '''F.'''",
                "shown.f: a is not described",
            ),
            ("class shown:\n '''A.'''\n def __init__(self, a): ...", "shown: a is not described"),
            ("@dataclass\nclass shown:\n '''A.'''\n a: int", "shown: a is not described"),
        ],
    )
    def test_the_rule_finds(self, code, fault):
        assert docstring_faults(ast.parse(f"'''M.'''\n{code}"), {"shown"}) == [fault]

    @pytest.mark.parametrize(
        "code",
        [
            "def _f(a): ...",
            "class _A:\n def f(self): ...",
            "def f(a):\n '''Do.'''",
            f"def shown(a, *b, c, **d):\n '''Do.\n\n{LISTED} a, *b\n  B.\n c\n  C.\n"
            " **d\n  D.\n\n Returns\n ---\n int\n  I.\n '''",
            "class shown:\n '''An A.'''\n @property\n def p(self):\n  '''A p.'''\n"
            " @p.setter\n def p(self, p): ...",
            "@dataclass\nclass shown:\n '''An A.\n\n Attributes\n ---\n a\n  An a.\n '''\n a: int",
        ],
    )
    def test_the_rule_allows(self, code):
        assert docstring_faults(ast.parse(f"'''M.'''\n{code}"), {"shown"}) == []

    def test_they_are_complete(self):
        assert found_by(lambda _, tree: docstring_faults(tree, EXPORTED)) == {}


class TestForbidden:
    @pytest.mark.parametrize(
        "line",
        [
            "import random",
            "from random import choice",
            "np.random.seed(1)",
            "x = numpy.random.rand(3)",
            "from numpy.random import randint",
            "np.random.mtrand._rand",
            "shuffle = np.random.shuffle",
            "np.random.RandomState(1)",
        ],
    )
    def test_shared_generators_are_found(self, line):
        assert random_faults(ast.parse(line))

    @pytest.mark.parametrize(
        "line",
        [
            "rng = np.random.default_rng(seed)",
            "def f(rng: np.random.Generator): ...",
            "from numpy.random import Generator",
            "problem.random.rand(2)",
        ],
    )
    def test_own_generators_are_allowed(self, line):
        assert random_faults(ast.parse(line)) == []

    def test_nobody_touches_a_shared_generator(self):
        own = ("get_state", "seed", "set_state")
        assert found_by(lambda _, tree: set(random_faults(tree))) == {
            "botohe_moo.study.run.child": {"random", "np.random.seed"},  # for algorithms that do
            # Whether algorithms do.
            "botohe_moo.testing.watching": {"random", *(f"np.random.{name}" for name in own)},
        }

    @pytest.mark.parametrize(
        "line",
        [
            "import pickle",
            "from pickle import loads",
            "def f():\n import dill",
            "yaml.load(text, yaml.Loader)",
            "from yaml import full_load",
            "yaml.unsafe_load(text)",
            "eval(text)",
            "exec(text)",
            "np.load(path, allow_pickle=True)",
            "pd.read_pickle(path)",
            "frame.to_pickle(path)",
        ],
    )
    def test_what_runs_what_it_reads_is_found(self, line):
        assert unsafe_faults(ast.parse(line))

    @pytest.mark.parametrize(
        "line",
        [
            "yaml.safe_load(text)",
            "json.load(file)",
            "re.compile(x)",
            "model.eval()",
            "np.load(path, allow_pickle=False)",
        ],
    )
    def test_what_only_reads_is_allowed(self, line):
        assert unsafe_faults(ast.parse(line)) == []

    def test_nothing_runs_what_it_reads(self):
        # What it has pickled itself.
        expected = {"botohe_moo.testing.watching": ["pickle"]}
        assert found_by(lambda _, tree: unsafe_faults(tree)) == expected
