"""How kernels are compiled: helpers stay plain Python, and private options can be done without."""

import ast
import gc
import importlib.util
import re
import sys
import time
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np
import pytest
from numba import config
from numba.core import event
from numba.core.cpu import CPUTargetOptions

import botohe_moo
from botohe_moo.base.types import FloatArray
from botohe_moo.core import compile as decorators
from botohe_moo.core.compile import _PRIVATE, array_maker, helper, is_kept, kernel, own_time, shared

SOURCES = sorted(Path(botohe_moo.__file__).parent.rglob("*.py"))
MOST_PARAMETERS, MOST_LINES = 8, 80


compiled = pytest.mark.skipif(bool(config.DISABLE_JIT), reason="Kernels are not compiled.")


def functions_of(path):
    """The functions of a module, and whether any of them is compiled."""
    nodes = ast.walk(ast.parse(path.read_text("utf-8")))
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef)]
    decorators = [decorator for node in functions for decorator in node.decorator_list]
    names = {getattr(decorator, "id", None) for decorator in decorators}
    return functions, bool(names & {"kernel", "helper", "inlined", "array_maker"})


def test_functions_are_of_a_size_that_people_read():
    found = [functions for functions, are_kernels in map(functions_of, SOURCES) if are_kernels]
    assert len(found) > 15
    for node in chain(*found):
        given = node.args
        n_parameters = len([*given.posonlyargs, *given.args, *given.kwonlyargs])
        assert n_parameters <= MOST_PARAMETERS, f"{node.name} has {n_parameters} parameters"
        n_lines = node.end_lineno - node.lineno + 1
        assert n_lines <= MOST_LINES, f"{node.name} has {n_lines} lines"


@compiled
def test_helpers_may_be_called_from_python_and_from_kernels():
    @helper
    def twice(x):
        return 2 * x

    @array_maker
    def filled(n, value):
        made = np.empty(n)
        made[:] = twice(value)
        return made

    @helper
    def half(x):
        return x / 0.0 if x < 0 else x / 2

    @kernel
    def whole(n, value):
        return filled(n, half(value)).sum()

    assert (twice(2), half(3.0), filled(2, 1.0).tolist()) == (4, 1.5, [2.0, 2.0])
    assert whole(3, 5.0) == 15.0
    assert whole(1, -1.0) == -np.inf  # IEEE arithmetic: no exception in a hot loop


class Inner(NamedTuple):
    values: FloatArray
    factor: float


class Outer(NamedTuple):
    inner: Inner
    totals: FloatArray


@helper
def scaled(inner, i):
    return inner.values[i] * inner.factor


@helper
def add_up(outer):
    for i in range(outer.inner.values.shape[0]):
        outer.totals[0] += scaled(outer.inner, i)


@compiled
def test_helpers_read_what_kernels_share():
    @kernel
    def total(outer):
        outer = shared(outer)
        add_up(outer)
        totals = outer.totals
        return totals[0] + outer.inner.factor

    values, totals = np.arange(4.0), np.zeros(1)
    outer = Outer(Inner(values, 0.5), totals)
    assert shared(outer) is outer
    for n in range(1, 4):
        assert total(outer) == 3.0 * n + 0.5
    assert sys.getrefcount(values) <= 4  # nobody holds on to it, or lets go of it twice
    assert values.tolist() == [0.0, 1.0, 2.0, 3.0]


def test_numba_still_knows_the_private_options():
    assert all(hasattr(CPUTargetOptions, name) for name in _PRIVATE)


def test_the_garbage_collector_is_as_it_was_after_compiling():
    @kernel
    def add(x, y):
        return x + y

    assert gc.isenabled()
    assert add(1, 2) == 3
    assert gc.isenabled()
    gc.disable()
    try:
        add(1.0, 2.0)
        assert not gc.isenabled()
    finally:
        gc.enable()


@compiled
class TestMachineCodeOnDisk:
    """That of the kernel of a module: it adds a number."""

    @pytest.fixture
    def loaded(self, tmp_path, monkeypatch):
        # Python takes bytecode for that of a file of the same size and second.
        monkeypatch.setattr(sys, "dont_write_bytecode", True)

        def loaded(number):
            """Load the module as another process would; return its kernel."""
            path = tmp_path / "adding.py"
            path.write_text(
                "from botohe_moo.core.compile import kernel\n\n\n"
                f"@kernel\ndef add(x):\n    return x + {number}\n"
            )
            decorators._digest.cache_clear()
            spec = importlib.util.spec_from_file_location("adding", path)
            module = importlib.util.module_from_spec(spec)
            monkeypatch.setitem(sys.modules, "adding", module)
            spec.loader.exec_module(module)
            return module.add

        return loaded

    def test_it_is_that_of_the_present_source(self, loaded, tmp_path):
        first, signature = loaded(1), (numba.int64,)
        assert not is_kept(first, signature)
        assert first(2) == 3
        assert is_kept(first, signature)
        assert not is_kept(first, (numba.float64,))
        again = loaded(1)
        assert is_kept(again, signature)
        assert again(2) == 3
        assert sum(again.stats.cache_hits.values()) == 1
        files = {*(tmp_path / "__pycache__").glob("*.nb?")}
        changed = loaded(5)
        assert not is_kept(changed, signature)
        assert changed(2) == 7
        others = {*(tmp_path / "__pycache__").glob("*.nb?")}
        assert len(others) == len(files) == 2
        assert not others & files  # that of other sources is of no use

    @pytest.mark.parametrize("kind", ["nbi", "nbc"])
    @pytest.mark.parametrize("content", [b"", b"no code", "cut off"])
    def test_where_it_is_damaged_it_is_made_again(self, loaded, tmp_path, kind, content):
        assert loaded(1)(2) == 3
        [path] = (tmp_path / "__pycache__").glob(f"*.{kind}")
        whole = path.read_bytes()
        path.write_bytes(whole[: len(whole) // 2] if content == "cut off" else content)
        is_index = kind == "nbi"
        assert is_kept(loaded(1), (numba.int64,)) != is_index
        assert loaded(1)(2) == 3
        again = loaded(1)
        assert again(2) == 3
        assert sum(again.stats.cache_hits.values()) == 1

    def test_where_it_is_still_being_written_it_is_not_there(self, loaded, tmp_path):
        assert loaded(1)(2) == 3
        [path] = (tmp_path / "__pycache__").glob("*.nbc")  # which numba writes after the index
        path.unlink()
        assert not is_kept(loaded(1), (numba.int64,))

    def test_where_none_could_be_there_is_none(self):
        assert not is_kept(numba.njit(lambda: 1), ())


KERNELS = re.compile(
    r"^from botohe_moo\.core\.compile import .*\b(kernel|at_once|helper|inlined)\b", re.M
)
IMPORTED = re.compile(r"^from botohe_moo\.([\w.]+) import", re.M)


def test_kernels_import_only_the_core_and_their_own_folder():
    root, found = Path(botohe_moo.__file__).parent, []
    for path in SOURCES:
        if KERNELS.search(text := path.read_text("utf-8")):
            own = ".".join(path.parent.relative_to(root).parts)
            found.append(path)
            for imported in IMPORTED.findall(text):
                assert imported.startswith(("base.", "core", own)), path
    assert len(found) > 15


def test_own_time_stands_still_while_anything_is_compiled():
    began, own = time.perf_counter(), own_time()
    with event.trigger_event("numba:compiler_lock"):
        stopped = own_time()
        time.sleep(0.05)
        with event.trigger_event("numba:compiler_lock"):  # of a helper, or in another thread
            assert own_time() == stopped
    assert stopped <= own_time()
    assert own_time() - own <= time.perf_counter() - began - 0.05
