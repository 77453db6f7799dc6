"""What commands print, and their exit statuses."""

from __future__ import annotations

import errno
import gc
import json
import logging
import math
import os
import re
import shutil
import signal
import sys
import textwrap
import threading
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, NoReturn, TextIO

import typer

from botohe_moo.base.runtime import hold_signals

if TYPE_CHECKING:
    from botohe_moo.base.parameters import Parameter
    from botohe_moo.mission.model import Mission

FAILED = 1
BAD_INPUT = 2
INTERRUPTED = 130

_MAX_WIDTH = 100


def run(app: typer.Typer) -> None:
    """Run a command line and end the process.

    The exit status is 0, or 1 where there is no result, 2 for bad input or a file that cannot be
    written, 130 after Ctrl-C.
    """
    # Libraries create a million objects while they load, none of which is garbage.
    gc.set_threshold(100_000)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")  # so that no character ends a run
    warnings.simplefilter("once", UserWarning)
    warnings.showwarning = lambda message, *_, **__: say(message)
    os.environ["MPLBACKEND"] = "Agg"  # pictures are only written to files
    # No warnings about fonts: a missing character can be seen in the picture.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    warnings.filterwarnings("ignore", "Glyph .* missing from")
    try:
        app()
    except MemoryError as error:
        say(f"there is not enough memory. {error}")
        sys.exit(FAILED)
    finally:
        gc.freeze()  # otherwise the interpreter searches all objects for cycles when it ends


# Characters that steer a terminal, except tabs and line feeds; line ends of Unicode; and marks that
# change the direction of writing, which labels in right-to-left scripts do not need.
_STEERING = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069]")


def harmless(message: object) -> str:
    r"""Write as escapes what steers a terminal, or reorders a line, in labels, titles and paths.

    >>> print(harmless("\x1b[31m nodes \u202e"))
    \x1b[31m nodes \u202e
    """
    return _STEERING.sub(lambda found: found[0].encode("unicode_escape").decode(), str(message))


def tell(message: object) -> None:
    """Print a result on standard output, if it is still open."""
    try:
        typer.echo(harmless(message))
    except OSError as error:  # a search must not be lost by `| head` or a closed terminal
        if error.errno not in (errno.EPIPE, errno.EIO):
            raise
        _drop(sys.stdout)


def say(message: object) -> None:
    """Print a message on standard error, if it is still open."""
    try:
        typer.echo(harmless(f"botohe: {message}"), err=True)
    except OSError:
        _drop(sys.stderr)


def _drop(stream: TextIO) -> None:
    """Drop further output; otherwise the interpreter ends with status 120."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def fail(message: object, status: int = BAD_INPUT) -> NoReturn:
    """Print a message on standard error and end the command."""
    say(message)
    raise typer.Exit(status)


@contextmanager
def failing(status: int = BAD_INPUT) -> Iterator[None]:
    """Turn a ValueError or an OSError into a message and an exit status."""
    try:
        yield
    except OSError as error:
        fail(f"{error.filename}: {error.strerror}" if error.filename else error, status)
    except ValueError as error:
        fail(error, status)


@contextmanager
def stoppable(answer: str) -> Iterator[threading.Event]:
    """Let Ctrl-C set an event, and print an answer at once, however long the current step takes.

    What has been found is to be printed and written inside of the block, after which the command
    ends with status 130 if it was stopped.

    Python calls handlers between two steps of the main thread, which may be inside of a kernel for
    minutes. Kernels hold no lock, though, and a signal is written to the wakeup descriptor at once:
    another thread reads it.
    """

    def wait() -> None:
        while (came := os.read(reader, 1)) and came[0] != signal.SIGINT:
            pass
        if came:
            # Not by rich or sys.stderr: the main thread may hold their locks. Below the bar.
            line = f"{os.linesep if os.isatty(2) else ''}botohe: {answer}{os.linesep}"
            with suppress(OSError):
                os.write(2, line.encode())

    with hold_signals(signal.SIGINT, handled=True) as pressed:
        reader, writer = os.pipe()
        os.set_blocking(writer, False)
        usual = signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
        thread = threading.Thread(target=wait, daemon=True)
        thread.start()
        try:
            yield pressed
        finally:
            signal.set_wakeup_fd(usual)
            os.close(writer)  # which ends the thread
            thread.join()
            os.close(reader)
    if pressed.is_set():
        raise typer.Exit(INTERRUPTED)


def brief(mission: Mission, max_length: float | None) -> str:
    """Describe the size of a mission and the travel budget, if there is one, in a line."""
    limit = "" if max_length in (None, math.inf) else f", travel budget {max_length:g}"
    return (
        f"{len(mission.nodes)} nodes, {len(mission.graph.edges)} arcs, {mission.team}, "
        f"total reward {mission.total_reward:g}{limit}"
    )


def parameter_text(parameter: Parameter) -> str:
    """Describe a parameter: its name, default, type, range and meaning."""
    kind = re.sub(r"Literal\[([^]]*)\]", r"\1", parameter.annotation).replace(" | ", " or ")
    kind = ", ".join(filter(None, (kind, parameter.range)))
    kind = f"  ({kind})" if kind else ""
    headline = parameter.name
    if not parameter.plain:
        kind = "  (from Python only)"
    elif not parameter.required:
        headline += f" = {_default(parameter)}"
    lines = [paragraph(f"{headline}{kind}", first="  ", indent=" " * 6)]
    if parameter.description:
        lines.append(paragraph(parameter.description, first=" " * 6, indent=" " * 6))
    return "\n".join(lines)


def parameter_example(parameter: Parameter) -> str:
    """Return a parameter as it is written on the command line."""
    return f"{parameter.name}={'VALUE' if parameter.required else _default(parameter)}"


def _default(parameter: Parameter) -> str:
    default = parameter.default
    if isinstance(default, Mapping):
        return "{" + ", ".join(f"{name}: {value}" for name, value in default.items()) + "}"
    return json.dumps(default) if default is None or isinstance(default, bool) else str(default)


def listing(entries: Iterable[tuple[str, str]]) -> str:
    """Lay out names and their descriptions in two columns."""
    entries = list(entries)
    widest = max((len(name) for name, _ in entries), default=0)
    return "\n".join(
        paragraph(text, first=f"{name:{widest}}  ", indent=" " * (widest + 2))
        for name, text in entries
    )


def paragraph(text: str, *, first: str = "", indent: str = "") -> str:
    """Remove docstring markup from a text, and wrap it to the terminal, if there is one."""
    text = re.sub(r":\w+:`~?([^`]*)`", r"\1", text).replace("``", "")
    columns = shutil.get_terminal_size((0, 0)).columns
    if not columns:
        return f"{first}{text}".rstrip()
    return textwrap.fill(
        text,
        max(min(columns, _MAX_WIDTH), len(indent) + 20),
        initial_indent=first,
        subsequent_indent=indent,
        break_on_hyphens=False,
        break_long_words=False,
    )
