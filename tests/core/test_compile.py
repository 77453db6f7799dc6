"""How kernels are compiled: helpers stay plain Python, and private options can be done without."""

import ast
import gc
import importlib.util
import sys
import time
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
from botohe_moo.core.compile import _PRIVATE, helper, is_kept, kernel, own_time, shared

MOST_PARAMETERS, MOST_LINES = 8, 80
KINDS = {"kernel", "helper", "inlined", "array_maker"}

compiled = pytest.mark.skipif(bool(config.DISABLE_JIT), reason="Kernels are not compiled.")


def test_functions_beside_kernels_are_of_a_size_that_people_read():
    n_found = 0
    for path in Path(botohe_moo.__file__).parent.rglob("*.py"):
        nodes = ast.walk(ast.parse(path.read_text("utf-8")))
        functions = [node for node in nodes if isinstance(node, ast.FunctionDef)]
        if not KINDS & {getattr(d, "id", None) for node in functions for d in node.decorator_list}:
            continue
        n_found += 1
        for node in functions:
            given = node.args
            n_parameters = len([*given.posonlyargs, *given.args, *given.kwonlyargs])
            assert n_parameters <= MOST_PARAMETERS, f"{node.name} has {n_parameters} parameters"
            n_lines = node.end_lineno - node.lineno + 1
            assert n_lines <= MOST_LINES, f"{node.name} has {n_lines} lines"
    assert n_found > 15


@compiled
def test_a_division_by_zero_in_a_helper_is_no_exception():
    """IEEE arithmetic: hot loops do not test for it."""
    inverse = helper(lambda x: 1.0 / x)
    assert kernel(lambda x: inverse(x))(0.0) == np.inf


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

    try:
        for toggle, value in ((gc.enable, 1), (gc.disable, 1.0)):
            toggle()
            before = gc.isenabled()
            assert add(value, 2) == 3
            assert gc.isenabled() == before
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
        first, signature, files = loaded(1), (numba.int64,), []
        assert not is_kept(first, signature)
        assert first(2) == 3
        assert is_kept(first, signature)
        assert not is_kept(first, (numba.float64,))
        for number, is_there in ((1, True), (5, False)):
            files.append({*(tmp_path / "__pycache__").glob("*.nb?")})
            again = loaded(number)
            assert is_kept(again, signature) == is_there
            assert again(2) == 2 + number
            assert sum(again.stats.cache_hits.values()) == is_there
        files.append({*(tmp_path / "__pycache__").glob("*.nb?")})
        assert [len(some) for some in files] == [2, 2, 2]
        assert not files[1] & files[2]  # that of other sources is of no use

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


def test_own_time_stands_still_while_anything_is_compiled():
    began, own = time.perf_counter(), own_time()
    with event.trigger_event("numba:compiler_lock"):
        stopped = own_time()
        time.sleep(0.05)
        with event.trigger_event("numba:compiler_lock"):  # of a helper, or in another thread
            assert own_time() == stopped
    assert stopped <= own_time()
    assert own_time() - own <= time.perf_counter() - began - 0.05
