"""How algorithms compare on a mission, and the matrix of all missions that opens a report."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from botohe_moo.indicators import INDICATORS
from botohe_moo.study.judge.scores import merge_ties
from botohe_moo.study.report.words import (
    count,
    distinct,
    fixed,
    interval,
    level,
    listed,
    main_indicator,
    significant,
)
from botohe_moo.study.store.tables import StudyTables

BETTER, WORSE, EQUAL = "+", "−", "="
_INVERSE = {BETTER: WORSE, WORSE: BETTER, EQUAL: EQUAL}


@dataclass(frozen=True)
class Standing:
    """How algorithms compare on a mission by the report's main indicator."""

    indicator: str
    medians: Mapping[str, str]  # with enough digits to tell different ones apart
    ranks: Mapping[str, float]  # of the medians; ties share a rank
    best: tuple[str, ...]  # labels of the algorithms with the best median
    # What marks refer to: the control, or else the first of the best. None where the control has
    # no run on the mission.
    rival: str | None
    # Of pairs that were tested: whether the first is better (+), worse (−), or neither (=).
    found: Mapping[tuple[str, str], str]

    def mark(self, label: str) -> str:
        """Give the mark of an algorithm against the rival; empty without a test."""
        return self.found.get((label, self.rival or ""), "")

    def against(self, label: str, mark: str) -> list[str]:
        """List the algorithms against which one has a mark."""
        return [other for other in self.medians if self.found.get((label, other)) == mark]


def standing(tables: StudyTables, mission: str) -> Standing:
    """Find out how algorithms compare on a mission."""
    indicator = main_indicator(tables.comparisons)
    column = f"{indicator}_median"
    rows = tables.summary[tables.summary["mission"] == mission].dropna(subset=column)
    labels = rows["algorithm"].tolist()
    medians = merge_ties(rows[column])
    more_is_better = INDICATORS[indicator].higher_is_better
    texts = distinct(medians, fixed) if more_is_better else distinct(medians, significant, digits=3)
    order = pd.Series(-medians if more_is_better else medians)
    found: dict[tuple[str, str], str] = {}
    tested = tables.comparisons
    tested = tested[(tested["mission"] == mission) & (tested["indicator"] == indicator)]
    for one, other, n, m, effect, apart in zip(
        *(tested[name] for name in ("algorithm", "other", "n", "n_other", "a12", "significant")),
        strict=True,
    ):
        if min(n, m) >= 2:
            mark = EQUAL if not apart else BETTER if effect > 0.5 else WORSE
            found[one, other], found[other, one] = mark, _INVERSE[mark]
    best = tuple(label for label, value in zip(labels, order, strict=True) if value == order.min())
    control = tables.control
    return Standing(
        indicator=indicator,
        medians=dict(zip(labels, texts, strict=True)),
        ranks=dict(zip(labels, order.rank().tolist(), strict=True)),
        best=best,
        rival=next(iter(best), None) if control is None else control if control in labels else None,
        found=found,
    )


def leader(tables: StudyTables, mission: str) -> str:
    """Say in a sentence or two which algorithm has the best median, and what the tests say."""
    stands = standing(tables, mission)
    labels, best = list(stands.medians), stands.best
    if not best:
        return "No runs yet."
    which = "largest" if INDICATORS[stands.indicator].higher_is_better else "smallest"
    name = f"median {INDICATORS[stands.indicator].label}"
    median = stands.medians[best[0]]
    if len(labels) == 1:
        return f"{best[0]} has a {name} of {median}."
    if len(best) == len(labels):
        said = f"All {len(labels)} algorithms have the same {name}, {median}."
        return said + _among(stands)
    if len(best) > 1:
        return f"{listed(best)} share the {which} {name}, {median}." + _among(stands)
    within = ""
    if stands.indicator == "area":
        rows = tables.summary[tables.summary["mission"] == mission]
        row = rows[rows["algorithm"] == best[0]].iloc[0]
        ends = interval(row["area_low"], row["area_high"])
        within = f" ({level(tables)} interval {ends})"
    return f"{best[0]} has the {which} {name}, {median}{within}." + _tested(stands, best[0])


def _among(stands: Standing) -> str:
    """Say which of the algorithms with the same median are better by the tests."""
    pairs = [
        f"{one} is better than {listed(beaten)}"
        for one in stands.best
        if (beaten := [x for x in stands.against(one, BETTER) if x in stands.best])
    ]
    return f" By the tests, which compare all runs, {'; '.join(pairs)}." if pairs else ""


def _tested(stands: Standing, label: str) -> str:
    """Say what the tests say about the leading algorithm."""
    others = len(stands.medians) - 1
    said = []
    for words, mark in (
        ("better than", BETTER),
        ("not told apart from", EQUAL),
        ("worse, though not by its median, than", WORSE),
    ):
        if found := stands.against(label, mark):
            all_others = len(found) == others > 1
            said.append(f"{words} {'all others' if all_others else listed(found)}")
    return f" By the tests it is {'; '.join(said)}." if said else ""


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
    name = INDICATORS[main_indicator(tables.comparisons)].label
    rival = "the best on the mission" if tables.control is None else tables.control
    return (
        f"Median {name} over runs, the best on a mission bold, its rank there in brackets. "
        f"{BETTER} is better than {rival}, {WORSE} worse, {EQUAL} not told apart from it "
        f"(Mann-Whitney, Holm, {tables.significance:g}); without a mark it is not tested. "
        "Medians that look different are not ties."
    )
