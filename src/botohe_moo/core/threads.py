"""Threads that share work whose results do not depend on them."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any


@contextmanager
def mapping(n_threads: int) -> Iterator[Callable[..., list[Any]]]:
    """Give a ``map`` whose calls are made by threads, this one among them.

    Kernels release Python's lock, so that they run at the same time. Whichever thread is free makes
    the next call. The threads end with the context, so that none is left to pickle, to fork or to
    close.
    """
    if n_threads == 1:
        yield lambda function, *arguments: list(map(function, *arguments))
        return
    with ThreadPoolExecutor(n_threads - 1) as pool:

        def map_in_threads(function: Callable[..., Any], *arguments: Any) -> list[Any]:
            calls = list(zip(*arguments, strict=True))
            made: list[Any] = [None] * len(calls)
            left = iter(range(len(calls)))

            def make_some() -> None:
                for i in left:
                    made[i] = function(*calls[i])

            others = [pool.submit(make_some) for _ in range(n_threads - 1)]
            try:
                make_some()
            finally:  # where a call of this thread fails, the others begin no more
                list(left)
            for other in others:
                other.result()
            return made

        yield map_in_threads
