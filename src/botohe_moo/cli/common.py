"""What all commands share: their options, what they print and show, and their exit statuses."""

from __future__ import annotations

import errno
import gc
import inspect
import io
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
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from copy import copy
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, TextIO, get_origin

import typer

import botohe_moo as bm
from botohe_moo.base.messages import counted, listed
from botohe_moo.base.runtime import hold_signals

if TYPE_CHECKING:
    from botohe_moo.base.parameters import Parameter

FAILED = 1
BAD_INPUT = 2
INTERRUPTED = 130

PICTURES = (".png", ".svg", ".pdf")
_MAX_WIDTH = 100
_NO_LIMIT = 10_000  # columns, where there is no terminal to wrap to
_SECONDS_BETWEEN_LINES = 6.0  # of progress, where there is no terminal
_TEXTS = ("base", "start", "end", "title")  # parameters of missions that stay as they are typed


Command = Callable[..., None]
Number = Annotated[int, typer.Option(min=0)]
Count = Annotated[int, typer.Option(min=1)]
CountOrNone = Annotated[int | None, typer.Option(min=1)]
Show = Callable[..., None]
"""Takes words, and optionally how much is done and of how much."""


def command(app: typer.Typer, name: str | None = None) -> Callable[[Command], Command]:
    """Make a command of a function: its help is the function's docstring.

    Keyword-only parameters are options, the others arguments. The section on parameters gives the
    help of each. After the colon stand its names, if they are not that of the parameter, and the
    name of its value. Options that are not in it are in the docstrings of `mission_options` and
    `shared_options`. A parameter ``options`` gets what `mission_options` returns.
    """

    def add(function: Command) -> Command:
        text, own = _documented(function)
        helps = _documented(shared_options)[1] | _documented(mission_options)[1] | own
        given = dict(inspect.signature(function, eval_str=True).parameters)
        takes_options = given.pop("options", None) is not None
        of_missions = inspect.signature(mission_options, eval_str=True).parameters
        added = {n: p for n, p in of_missions.items() if takes_options and n not in given}

        def run(**values: Any) -> None:
            if takes_options:
                with failing():
                    values["options"] = mission_options(**{n: values.pop(n) for n in added})
            function(**values)

        parameters = [_stated(p, *helps[n]) for n, p in (given | added).items()]
        run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        app.command(name or function.__name__, help=text)(run)
        return function

    return add


def _documented(function: Callable[..., Any]) -> tuple[str, dict[str, tuple[str, str]]]:
    """Return the text of a docstring, and the names and the help of each parameter."""
    text, _, section = (inspect.getdoc(function) or "").partition("\n\nParameters\n----------\n")
    entries = re.findall(r"^(\w+)(?: : (.*))?\n((?:    .*\n?)+)", section, re.MULTILINE)
    return text, {name: (names, " ".join(words.split())) for name, names, words in entries}


def _stated(parameter: inspect.Parameter, names: str, words: str) -> inspect.Parameter:
    """Return a parameter as typer wants it."""
    hint, is_option = parameter.annotation, parameter.kind is parameter.KEYWORD_ONLY
    info: Any = typer.Option() if is_option else typer.Argument()
    if get_origin(hint) is Annotated:
        hint, info = parameter.annotation.__origin__, copy(parameter.annotation.__metadata__[0])
    flags = re.findall(r"(?<!\S)--?[a-z-]+", names)
    info.metavar, info.help = " ".join(names.split()[len(flags) :]) or None, words
    if is_option:
        has_long = any(flag.startswith("--") for flag in flags)
        own = [] if has_long else [f"--{parameter.name.replace('_', '-')}"]
        info.param_decls = (*own, *flags)
        info.parser = _path if hint in (Path, Path | None) else info.parser
    return parameter.replace(kind=parameter.KEYWORD_ONLY, annotation=Annotated[hint, info])


def _path(text: str) -> Path:
    """Refuse an empty text, which the shell makes of an unset variable: it names this folder."""
    if not text:
        raise typer.BadParameter("expected a path, got an empty text.")
    return Path(text)


def shared_options() -> None:
    """Describe options that several commands take.

    Parameters
    ----------
    mission : MISSION
        A mission's name, or a mission file.
    parameter : -p NAME=VALUE
        A parameter of the algorithm, such as n_ants=50. Repeatable.
    evaluations : -n N
        Trail plans to evaluate in each search.
    seed : -s S
        Seed of the random numbers.
    min_survival : P
        Survival floor: the least survival probability of each robot.
    max_length : L
        Travel budget: the greatest length of each trail, in the unit of the arcs. By default the
        mission's own; inf for none.
    folder : DIR
        Folder that `solve` wrote.
    choose : WISH
        Choose a plan, as `botohe choose` does: "survivors >= 2". Repeatable: a plan has to meet all
        wishes.
    open_page : --open
        Open the page in the browser.
    plan : ID
        A plan of front.csv, by its plan_id.
    price : REWARD
        The reward that one more survivor is worth. By default the slope of the front at the plan.
    file : FILE
        A study file (YAML).
    study : DIR
        Folder that `botohe study run` wrote.
    out : -o DIR
        Folder of the study. By default results/NAME.
    workers : -w N
        Runs at a time. By default one for each processor.
    selection : SELECTION
        A mission's name, a family, or one of small, medium, large, all.
    library : DIR
        Folder of the library. By default the one of the package.
    policy : NAME
        When to replan. "losses": after each loss. "arrivals": whenever robots reach a node. "one by
        one": robots go one after another, most hops first. "shortest first": the same, fewest hops
        first. "static": never.
    """


def mission_options(
    *,
    robots: int | None = None,
    base: str | None = None,
    danger: float | None = None,
    hazard: Path | None = None,
    scenario: list[str] | None = None,
    mission_parameter: list[str] | None = None,
) -> dict[str, Any]:
    """Collect the parameters of a mission, some of which are options of their own.

    Parameters
    ----------
    robots : K
        Number of robots.
    base : NODE
        Node that is the base. By default the one that the mission file names, or the first charger
        of a building.
    danger : D
        Rate of loss for a unit of length. An arc without a survival gets exp(-D * length).
    hazard : FILE
        Map of dangerous places: YAML for the map server of Nav2, with mode: scale. Where it is
        black, the rate of loss is --danger.
    scenario : NAME=P,...
        A scenario and its probability, such as "storm=0.2,factor=8,zone=east": hazards are
        multiplied by the factor, on arcs that begin or end in the zone. Those of the file are left
        out then. Repeatable.
    mission_parameter : -m NAME=VALUE
        A parameter of the mission, such as nodes=500. All mission files take reward=2 and
        both_ways=true. Repeatable.
    """
    own: dict[str, Any] = {"robots": robots, "base": base, "danger": danger}
    own |= {"hazard": hazard and str(hazard), "scenarios": scenario or None}
    return with_options(read_parameters(mission_parameter), **own)


def with_options(parameters: dict[str, Any], **own: Any) -> dict[str, Any]:
    """Add options that are given to parameters of a mission; none may be given twice."""
    given = {name: value for name, value in own.items() if not (value is None or value is False)}
    for name in given.keys() & parameters.keys():
        raise ValueError(f"Expected --{name.replace('_', '-')} or -m {name}=VALUE, got both.")
    return parameters | given


def read_parameters(pairs: Iterable[str] | None) -> dict[str, Any]:
    """Read NAME=VALUE pairs: numbers as in Python, everything else as in YAML.

    A label stays the text that was typed, as the mission knows what its labels are.
    """
    found: dict[str, Any] = {}
    for pair in pairs or ():
        name, equals, value = (part.strip() for part in pair.partition("="))
        if not equals or not name.isidentifier():
            raise ValueError(f"Expected a parameter as NAME=VALUE, got {pair!r}.")
        if name in found:
            raise ValueError(f"Expected {name!r} once, got it again: {pair.strip()!r}.")
        found[name] = value if name in _TEXTS else _value(name, value)
    return found


def _value(name: str, text: str) -> Any:
    for number in (int, float):
        with suppress(ValueError):
            return number(text)
    from botohe_moo.base.documents import Document

    try:
        return Document(text).content
    except ValueError:
        expected = f"a number, true, false or text for {name!r}"
        raise ValueError(f"Expected {expected}, got {text!r}.") from None


def run(app: typer.Typer) -> None:
    """Run a command line and end the process.

    The exit status is 0, or 1 where there is no result or nowhere to write it, 2 for bad input,
    130 after Ctrl-C.
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
    except OSError as error:  # where help is written to
        _drop(sys.stdout)
        say(_reason(error))
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
    """Print a result on standard output, if it is still open; the command ends if it is full."""
    try:
        typer.echo(harmless(message))
    except OSError as error:
        _drop(sys.stdout)
        # A search must not be lost by `| head` or a closed terminal.
        if error.errno not in (errno.EPIPE, errno.EIO):
            fail(_reason(error), FAILED)


def say(message: object) -> None:
    """Print a message on standard error, if it is still open."""
    try:
        typer.echo(harmless(f"botohe: {message}"), err=True)
    except OSError:
        _drop(sys.stderr)


def _drop(stream: TextIO) -> None:
    """Drop further output; otherwise the interpreter ends with status 120."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _reason(error: OSError) -> str:
    return f"{error.filename or 'standard output'}: {error.strerror}"


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
        fail(_reason(error) if error.filename else error, status)
    except ValueError as error:
        fail(error, status)


@contextmanager
def stoppable(answer: str) -> Iterator[threading.Event]:
    """Let Ctrl-C set an event, and print an answer at once, however long the current step takes.

    Print and write inside of the block what was found. After it the command ends with status 130
    if it was stopped.

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


@contextmanager
def showing(words: str, *, every: float = _SECONDS_BETWEEN_LINES) -> Iterator[Show]:
    """Show words, beside a bar or in lines, until the function that is yielded shows others.

    A bar without a total moves to and fro. Where standard error is not a terminal, the words are
    printed every few seconds. It is also shown when kernels are being compiled.
    """
    latest = words
    # rich would call it a terminal if FORCE_COLOR is set, as it often is for logs.
    is_terminal = sys.stderr is not None and sys.stderr.isatty()
    with _bar() if is_terminal else _lines(every) as put:

        def show(words: str, done: float = 0.0, total: float | None = None) -> None:
            nonlocal latest
            latest = words
            put(words, done, total)

        show(words)
        with _noting_compiling(lambda begins: put("compiling" if begins else latest)):
            yield show


@contextmanager
def _noting_compiling(note: Callable[[bool], None]) -> Iterator[None]:
    """Call a function when numba begins to compile a kernel, and when the kernel is compiled.

    Functions that the kernel calls are compiled in between, which is not reported.
    """
    from numba.core import event

    depth, is_first = 0, True

    class Listener(event.Listener):
        def on_start(self, event: Any) -> None:  # noqa: ARG002
            nonlocal depth, is_first
            if is_first:
                say("compiling for this machine, once.")
                is_first = False
            depth += 1
            if depth == 1:
                note(True)

        def on_end(self, event: Any) -> None:  # noqa: ARG002
            nonlocal depth
            depth -= 1
            if depth == 0:
                note(False)

    with event.install_listener("numba:compile", Listener()):
        yield


@contextmanager
def _bar() -> Iterator[Show]:
    from rich import progress
    from rich.console import Console

    bar = progress.Progress(
        progress.BarColumn(bar_width=16),
        progress.TaskProgressColumn(),
        progress.TextColumn("{task.fields[words]} ", markup=False),
        progress.TimeElapsedColumn(),
        progress.TimeRemainingColumn(),
        progress.TextColumn("left"),
        console=Console(stderr=True),
        redirect_stdout=False,
    )
    task = bar.add_task("", total=None, words="")
    bar.start()

    def put(words: str, done: float = 0.0, total: float | None = None) -> None:
        given = None if total is None else done  # without a total, both stay as they are
        bar.update(task, words=harmless(words), completed=given, total=total)

    try:
        yield put
    finally:
        with suppress(OSError):  # the terminal has been closed
            bar.stop()


@contextmanager
def _lines(every: float) -> Iterator[Show]:
    latest, over, started = "", threading.Event(), time.monotonic()

    def put(words: str, *_: object) -> None:
        nonlocal latest
        latest = words

    def speak() -> None:
        while not over.wait(every):
            say(f"{latest}, {timedelta(seconds=int(time.monotonic() - started))}")

    thread = threading.Thread(target=speak, daemon=True)
    thread.start()
    try:
        yield put
    finally:
        over.set()
        thread.join()


def paragraph(text: str, indent: str = "") -> str:
    """Remove docstring markup from a text, and wrap it to the terminal, if there is one."""
    from rich.text import Text

    wrapped = _rendered(Text(plain(text)), max(_width() - len(indent), 20))
    return textwrap.indent(wrapped, indent)


def table(rows: Iterable[Sequence[str]], *, n_texts: int = 2, wrap: bool = False) -> str:
    """Lay out rows in columns: the first ``n_texts`` to the left, numbers to the right.

    All but the first column are wrapped to the terminal, if there is one, where that is wanted.
    """
    from rich.table import Table
    from rich.text import Text

    rows = list(rows)
    grid = Table.grid(padding=(0, 2, 0, 0))
    for number in range(len(rows[0])):
        justify: Any = "left" if number < n_texts else "right"
        grid.add_column(justify=justify, no_wrap=not (wrap and number), overflow="fold")
    for row in rows:
        grid.add_row(*(Text(harmless(cell)) for cell in row))
    return _rendered(grid, max(_width(), 44) if wrap else _NO_LIMIT)  # texts need some width


def frame_table(frame: Any, columns: Mapping[str, tuple[str, str]], n_texts: int = 1) -> str:
    """Lay out a table: its header and format are given by column; columns without values go."""
    shown = [
        [title, *(format(value, spec) if value == value else "-" for value in frame[name])]
        for name, (title, spec) in columns.items()
        if frame[name].notna().any()
    ]
    return table(zip(*shown, strict=True), n_texts=n_texts)


def _rendered(shown: Any, width: int) -> str:
    from rich.console import Console

    page = io.StringIO()
    console = Console(file=page, width=width, color_system=None, legacy_windows=False)
    console.print(shown)
    return "\n".join(line.rstrip() for line in page.getvalue().rstrip("\n").split("\n"))


def _width() -> int:
    columns = shutil.get_terminal_size((0, 0)).columns
    return min(columns, _MAX_WIDTH) if columns else _NO_LIMIT


def plain(text: str) -> str:
    """Remove the markup of docstrings from a text."""
    return re.sub(r":\w+:`~?([^`]*)`", r"\1", text).replace("``", "")


def brief(mission: bm.Mission, max_length: float | None) -> str:
    """Describe the size of a mission and the travel budget, if there is one, in a line."""
    limit = "" if max_length in (None, math.inf) else f", travel budget {max_length:g}"
    found = listed(f"{one.name} {one.probability:g}" for one in mission.scenarios)
    scenarios = f", {counted(len(mission.scenarios), 'scenario')}: {found}" if found else ""
    size = f"{len(mission.nodes)} nodes, {len(mission.graph.edges)} arcs, {mission.team}"
    return f"{size}, total reward {mission.total_reward:g}{limit}{scenarios}"


def parameter_text(parameter: Parameter) -> str:
    """Describe a parameter: its name, default, type, range and meaning."""
    kind = re.sub(r"Literal\[([^]]*)\]", r"\1", parameter.annotation).replace(" | ", " or ")
    kind = ", ".join(filter(None, (kind, parameter.range)))
    headline = parameter.name
    if not parameter.plain:
        kind = "from Python only"
    elif not parameter.required:
        headline = parameter_example(parameter).replace("=", " = ", 1)
    lines = [paragraph(f"{headline}  ({kind})" if kind else headline, indent="  ")]
    if parameter.description:
        lines.append(paragraph(parameter.description, indent=" " * 6))
    return "\n".join(lines)


def parameter_example(parameter: Parameter) -> str:
    """Return a parameter as it is written on the command line."""
    value = parameter.default
    if parameter.required:
        value = "VALUE"
    elif isinstance(value, Mapping):
        value = "{" + ", ".join(f"{name}: {of}" for name, of in value.items()) + "}"
    elif value is None or isinstance(value, bool):
        value = json.dumps(value)
    return f"{parameter.name}={value}"
