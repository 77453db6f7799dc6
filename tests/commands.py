"""The ``botohe`` command in the process of the tests, which is much faster than one of its own."""

from typing import NamedTuple

from typer.testing import CliRunner

from botohe_moo.cli import app


class Ended(NamedTuple):
    status: int
    out: str
    err: str


def run_botohe(*args, **env):
    """Run a command line; ``env`` are variables of its environment.

    That kernels are being compiled is left out of what it says, as nobody knows when they are.
    """
    done = CliRunner(env={"COLUMNS": None, **env}).invoke(app, list(map(str, args)))
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return Ended(done.exit_code, done.stdout, without_compiling(done.stderr))


def without_compiling(text):
    return "".join(line for line in text.splitlines(keepends=True) if "compiling" not in line)
