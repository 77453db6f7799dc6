"""The processor's counter of ticks, for kernels that say what they spend their time on."""

import time
from typing import Any

from numba import extending, types


def ticks() -> int:
    """Return how far the counter is: ticks of a constant rate that depends on the processor."""
    return time.perf_counter_ns()


@extending.intrinsic  # type: ignore[misc]
def _read_counter(_context: Any) -> Any:
    def generate(_context: Any, builder: Any, _signature: Any, _arguments: Any) -> Any:
        from llvmlite import ir

        counter = builder.module.declare_intrinsic(
            "llvm.readcyclecounter", fnty=ir.FunctionType(ir.IntType(64), [])
        )
        return builder.call(counter, [])

    return types.int64(), generate


@extending.overload(ticks)
def _ticks() -> Any:
    return lambda: _read_counter()
