"""Performing runs on a Dask cluster."""

import warnings
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from typing import Any

from botohe_moo.study.model import Run, StudyError
from botohe_moo.study.perform import Outcome, in_a_line
from botohe_moo.study.pool import WorkerPool, environment

_SECONDS_TO_CONNECT = 10


def dask_outcomes(
    runs: Sequence[Run], *, address: str, stopped: Callable[[], bool]
) -> Generator[tuple[Run, Outcome], None, None]:
    """Perform runs on a Dask cluster; yield their outcomes as they end.

    Workers need no access to this machine's disk. Runs of a worker that has another version of this
    package or an algorithm fail, and say why. If a worker dies, Dask gives its runs to another.
    ``stopped`` is asked five times a second; when it is true, waiting runs are cancelled, and the
    others are not waited for.
    """
    try:
        import distributed

        connect: Any = distributed.Client  # untyped
        client = connect(address, timeout=_SECONDS_TO_CONNECT, set_as_default=False)
    except ImportError:
        raise StudyError("Dask is not installed: pip install 'botohe-moo[dask]'.") from None
    except (OSError, ValueError) as error:
        reason = str(error).partition("\n")[0]
        raise StudyError(f"No Dask scheduler answers at {address!r} ({reason}).") from None
    with client:
        answers = client.run(environment, on_error="return")
        for worker, answer in answers.items():
            if isinstance(answer, Exception):  # it would end, and its runs would wait for others
                raise StudyError(f"{worker} cannot perform runs: {in_a_line(answer)}.")
        if not answers:
            warnings.warn(f"{address} has no Dask workers; waiting for one.", stacklevel=3)
        # Retries are of a run whose worker fails; Dask's own limit holds for workers that die.
        executor = client.get_executor(pure=False, retries=3)
        run_of = {executor.submit(_perform_on_worker, run): run for run in runs}
        try:
            while run_of and not stopped():
                ended, _ = wait(run_of, 0.2, FIRST_COMPLETED)
                for future in ended:
                    yield run_of.pop(future), _outcome(future)
        finally:
            executor.shutdown(wait=False)


def _outcome(future: Future[Outcome]) -> Outcome:
    try:
        return future.result()
    except (CancelledError, OSError):
        raise StudyError("The Dask scheduler is gone; run the study again to go on.") from None
    except Exception as error:
        return Outcome(error=f"the Dask worker failed ({in_a_line(error)})")


# One pool serves all threads of a Dask worker; its processes end with the worker's.
_POOL = WorkerPool()


def _perform_on_worker(run: Run) -> Outcome:
    outcome: Outcome
    [(_, outcome)] = _POOL.perform([run])
    return outcome
