"""The matrix that opens a report: missions × algorithms, with medians, marks and ranks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from botohe_moo.study.report.standing import BETTER, EQUAL, WORSE, Standing, standing
from botohe_moo.study.report.words import INDICATORS, count, fixed, main_indicator
from botohe_moo.study.store.tables import StudyTables

_MARKS = (BETTER, EQUAL, WORSE)
_EMPTY = "–"


@dataclass(frozen=True)
class Cell:
    """The cell of an algorithm and a mission."""

    text: str  # the median; a dash where there are no runs
    mark: str = ""  # +, − or =: better than what it is compared with, worse, or neither
    rank: str = ""  # of the median on the mission
    best: bool = False


@dataclass(frozen=True)
class Matrix:
    """Medians of all algorithms on all missions; the longer list goes down the page."""

    header: Sequence[str]  # what the rows are, and the names of the columns
    rows: Sequence[tuple[str, Sequence[Cell]]]
    caption: str


def matrix(tables: StudyTables) -> Matrix:
    """Make the matrix of missions and algorithms."""
    missions, algorithms = tables.mission_labels, tables.algorithm_labels
    stands = {mission: standing(tables, mission) for mission in missions}
    cells = {
        (mission, algorithm): _cell(stands[mission], algorithm)
        for mission in missions
        for algorithm in algorithms
    }
    further = _further(tables, stands)
    caption = _caption(tables)
    if len(algorithms) > len(missions):
        rows = [
            (a, [*(cells[m, a] for m in missions), *(column[a] for column in further.values())])
            for a in algorithms
        ]
        return Matrix(["algorithm", *missions, *further], rows, caption)
    rows = [(m, [cells[m, a] for a in algorithms]) for m in missions]
    rows += [(name, [column[a] for a in algorithms]) for name, column in further.items()]
    return Matrix(["mission", *algorithms], rows, caption)


def _cell(stands: Standing, algorithm: str) -> Cell:
    if algorithm not in stands.medians:
        return Cell(_EMPTY)
    return Cell(
        stands.medians[algorithm],
        stands.mark(algorithm),
        count(stands.ranks[algorithm]),
        algorithm in stands.best,
    )


def _further(tables: StudyTables, stands: Mapping[str, Standing]) -> dict[str, dict[str, Cell]]:
    """Give what sums up the missions: the count of each mark, and average ranks."""
    labels = tables.algorithm_labels
    columns: dict[str, dict[str, Cell]] = {}
    if len(stands) > 1 and tables.control is not None:
        marks = {a: Counter(of_one.mark(a) for of_one in stands.values()) for a in labels}
        columns[" / ".join(_MARKS)] = {
            a: Cell(_EMPTY if a == tables.control else " / ".join(str(found[m]) for m in _MARKS))
            for a, found in marks.items()
        }
    ranks = tables.ranks[tables.ranks["indicator"] == main_indicator(tables.comparisons)]
    if len(stands) > 1 and len(ranks):
        averages = dict(zip(ranks["algorithm"], ranks["average_rank"], strict=True))
        least = min(averages.values())
        columns["average rank"] = {
            a: Cell(fixed(averages.get(a), 2), best=averages.get(a) == least) for a in labels
        }
    return columns


def _caption(tables: StudyTables) -> str:
    name = INDICATORS[main_indicator(tables.comparisons)]
    rival = "the best on the mission" if tables.control is None else tables.control
    return (
        f"Median {name} over runs, the best on a mission bold, its rank there in brackets. "
        f"{BETTER} is better than {rival}, {WORSE} worse, {EQUAL} not told apart from it "
        f"(Mann-Whitney, Holm, {tables.significance:g}); without a mark it is not tested. "
        "Medians that look different are not ties."
    )
