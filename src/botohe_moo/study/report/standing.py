"""The matrix of all missions and algorithms that opens a report."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from scipy import stats

from botohe_moo.indicators import INDICATORS
from botohe_moo.study.judge.scores import best_first
from botohe_moo.study.report.words import count, distinct, fixed, main_indicator, significant
from botohe_moo.study.store.tables import StudyTables

_MARKS = ("+", "=", "−")
_BETTER, _EQUAL, _WORSE = _MARKS
_INVERSE = {_BETTER: _WORSE, _WORSE: _BETTER, _EQUAL: _EQUAL}


@dataclass(frozen=True)
class Cell:
    """The cell of an algorithm and a mission."""

    text: str = "–"  # the median; a dash where there are no runs
    mark: str = ""  # +, − or =: better than what it is compared with, worse, or neither
    rank: str = ""  # of the median on the mission
    best: bool = False


@dataclass(frozen=True)
class Matrix:
    """Medians of all algorithms on all missions; the longer list goes down the page."""

    header: Sequence[str]  # what the rows are, and the names of the columns
    rows: Sequence[tuple[str, Sequence[Cell]]]


def matrix(tables: StudyTables) -> Matrix:
    """Return the matrix of missions and algorithms."""
    missions, algorithms = tables.mission_labels, tables.algorithm_labels
    columns = {mission: _cells(tables, mission) for mission in missions}
    further = _further(tables, columns)
    if len(algorithms) >= len(missions):
        columns |= further
        rows = [(a, [of_one[a] for of_one in columns.values()]) for a in algorithms]
        return Matrix(["algorithm", *columns], rows)
    named = [*columns.items(), *further.items()]
    rows = [(name, [of_one[a] for a in algorithms]) for name, of_one in named]
    return Matrix(["mission", *algorithms], rows)


def _cells(tables: StudyTables, mission: str) -> dict[str, Cell]:
    """Return the cell of each algorithm on a mission, by the report's main indicator."""
    cells = dict.fromkeys(tables.algorithm_labels, Cell())
    indicator = main_indicator(tables.comparisons)
    rows = tables.summary[tables.summary["mission"] == mission]
    medians = rows.set_index("algorithm")[f"{indicator}_median"].dropna()
    if medians.empty:
        return cells
    if INDICATORS[indicator].higher_is_better:
        texts = distinct(medians, fixed)
    else:
        texts = distinct(medians, significant, digits=3)
    ranks = stats.rankdata(best_first(indicator, medians.to_list()))
    best = ranks == ranks.min()
    marks = _marks(tables, mission, rival=tables.control or medians.index[best][0])
    for i, label in enumerate(medians.index):
        cells[label] = Cell(texts[i], marks.get(label, ""), count(ranks[i]), bool(best[i]))
    return cells


def _marks(tables: StudyTables, mission: str, *, rival: str) -> dict[str, str]:
    """Return the marks of the algorithms that were tested against a rival on a mission."""
    rows = tables.comparisons
    rows = rows[(rows["mission"] == mission) & (rows["indicator"] == main_indicator(rows))]
    found = {}
    for row in rows.to_dict("records"):
        if min(row["n"], row["n_other"]) >= 2:
            better = _BETTER if row["a12"] > 0.5 else _WORSE
            mark = better if row["significant"] else _EQUAL
            found[row["algorithm"], row["other"]] = mark
            found[row["other"], row["algorithm"]] = _INVERSE[mark]
    return {label: mark for (label, other), mark in found.items() if other == rival}


def _further(
    tables: StudyTables, columns: Mapping[str, Mapping[str, Cell]]
) -> dict[str, dict[str, Cell]]:
    """Return what sums up the missions: the count of each mark, and average ranks."""
    labels = tables.algorithm_labels
    further: dict[str, dict[str, Cell]] = {}
    if len(columns) > 1 and tables.control is not None:
        marks = {a: Counter(of_one[a].mark for of_one in columns.values()) for a in labels}
        counts = {a: "/".join(str(marks[a][mark]) for mark in _MARKS) for a in labels}
        further["/".join(_MARKS)] = {
            a: Cell() if a == tables.control else Cell(counts[a]) for a in labels
        }
    ranks = tables.ranks[tables.ranks["indicator"] == main_indicator(tables.comparisons)]
    if len(columns) > 1 and len(ranks):
        averages = dict(zip(ranks["algorithm"], ranks["average_rank"], strict=True))
        further["average rank"] = {
            a: Cell(fixed(averages.get(a), 2), best=averages.get(a) == min(averages.values()))
            for a in labels
        }
    return further


def matrix_caption(tables: StudyTables) -> str:
    """Return what the matrix shows, and how to read it."""
    name = INDICATORS[main_indicator(tables.comparisons)].label
    rival = tables.control or "the best on the mission"
    n_lost = int((tables.runs["status"] != "done").sum())
    lost = f" Of all runs {n_lost} are not done; without a front their area is 0." if n_lost else ""
    return (
        f"Median {name} over runs, the best on a mission bold, its rank there in brackets. "
        f"{_BETTER} is better than {rival}, {_WORSE} worse, {_EQUAL} not told apart from it "
        f"(Mann-Whitney, Holm, {tables.significance:g}); without a mark it is not tested. "
        f"Medians that look different are not ties.{lost}"
    )
