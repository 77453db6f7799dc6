"""The columns of a study's tables: names, types and meanings."""

from collections.abc import Callable, Iterator, Mapping
from typing import TypeAlias

import pyarrow as pa

from botohe_moo.indicators import INDICATORS, further_indicators

TEXT, INTEGER, NUMBER, FLAG = pa.string(), pa.int64(), pa.float64(), pa.bool_()
FURTHER = "further"  # key of a schema's metadata, where it has columns that depend on the study


# Name, type and description; in which case it is missing, if it may be.
_Column: TypeAlias = tuple[str, pa.DataType, str] | tuple[str, pa.DataType, str, str]


def _schema(*columns: _Column, further: str = "") -> pa.Schema:
    fields = [
        pa.field(name, dtype, bool(missing), {"description": "; missing ".join([what, *missing])})
        for name, dtype, what, *missing in columns
    ]
    return pa.schema(fields, {FURTHER: further} if further else None)


_MISSION = ("mission", TEXT, "label of the mission in the study file")
_RUN = (
    ("run", TEXT, "identity of the run: digest of all that its result depends on"),
    _MISSION,
    ("algorithm", TEXT, "label of the algorithm in the study file"),
    ("seed", INTEGER, "seed of the run's random numbers"),
)
_PLAN = (
    ("reward", NUMBER, "E[R], expected team reward"),
    ("survivors", NUMBER, "E[S], expected number of surviving robots"),
)
_LIMITS = (
    ("min_survival", NUMBER, "survival floor of every robot"),
    ("max_length", NUMBER, "travel budget of every robot", "where there is none"),
)
_EVALUATIONS = ("evaluations", INTEGER, "trail plans evaluated so far")
_SECONDS = ("seconds", NUMBER, "the algorithm's own time so far, without recording")


def _scores(ending: str, what: str) -> list[_Column]:
    """Return a column for each indicator that a study need not have."""
    return [
        (f"{name}{ending}", NUMBER, f"{what} {known.in_words}", "where it is not computed")
        for name, known in INDICATORS.items()
        if name in further_indicators()
    ]


# Functions: their columns depend on the indicators that are registered.
_TABLES: dict[str, pa.Schema | Callable[[], pa.Schema]] = {
    "runs": _schema(
        *_RUN,
        ("status", TEXT, "done, infeasible, timeout or failed"),
        ("stopped_by", TEXT, "evaluations, seconds, itself, limit (killed) or error"),
        ("began", TEXT, "when, as 2026-11-22T04:30:12Z", "where it never did"),
        ("evaluations", INTEGER, "trail plans evaluated"),
        ("seconds", NUMBER, "the algorithm's own time, without recording and indicators"),
        ("recording_seconds", NUMBER, "time spent on recording fronts"),
        ("budget_evaluations", INTEGER, "evaluations allowed", "where there is no limit"),
        ("budget_seconds", NUMBER, "seconds allowed", "where there is no limit"),
        *_LIMITS,
        ("area", NUMBER, "area of the final front, in [0, 1]"),
        ("front_size", INTEGER, "points on the final front"),
        ("ties", INTEGER, "further plans on it whose objectives are those of a point"),
        ("environment", TEXT, "where it ran: a row of environments"),
        ("error", TEXT, "what went wrong, in a line", "where nothing did"),
        ("traceback", TEXT, "where it went wrong", "where nothing did"),
    ),
    "trace": lambda: _schema(
        *_RUN,
        _EVALUATIONS,
        _SECONDS,
        ("area", NUMBER, "area of the front, in [0, 1]"),
        ("front_size", INTEGER, "points on the front"),
        ("ties", INTEGER, "further plans on it whose objectives are those of a point"),
        *_scores("", "its"),
    ),
    "fronts": _schema(*_RUN, _EVALUATIONS, *_PLAN),
    "plans": _schema(
        *_RUN,
        ("plan_id", INTEGER, "number of the plan on the final front, by descending reward"),
        *_PLAN,
        ("trails", TEXT, "the robots' trails, lists of node labels as JSON"),
    ),
    "indicators": lambda: _schema(
        *_RUN,
        ("indicator", TEXT, f"one of {', '.join(INDICATORS)}"),
        ("value", NUMBER, "its value for the final front, those of a mission within 1e-12 equal"),
        ("reference", TEXT, "the reference front, a key of references", "if it needs none"),
    ),
    "references": _schema(
        ("reference", TEXT, "digest of the front's points"),
        _MISSION,
        *_PLAN,
    ),
    "bounds": _schema(
        _MISSION,
        ("reward", NUMBER, "E[R] of a point; one of them weakly dominates each plan"),
        ("survivors", NUMBER, "E[S] of the point"),
    ),
    "comparisons": _schema(
        _MISSION,
        ("indicator", TEXT, "what is compared"),
        ("algorithm", TEXT, "label of the first algorithm"),
        ("other", TEXT, "label of the second, the control where there is one"),
        ("n", INTEGER, "runs of the first"),
        ("n_other", INTEGER, "runs of the second"),
        ("median", NUMBER, "median of the first"),
        ("median_other", NUMBER, "median of the second"),
        ("p_value", NUMBER, "of the two-sided Mann-Whitney test"),
        ("p_holm", NUMBER, "corrected by Holm over the mission's comparisons by this indicator"),
        ("a12", NUMBER, "probability that a run of the first is better, ties counted half"),
        ("a12_low", NUMBER, "lower end of its confidence interval"),
        ("a12_high", NUMBER, "upper end of its confidence interval"),
        ("significant", FLAG, "whether p_holm is below the significance level"),
        ("verdict", TEXT, "the same in words"),
    ),
    "ranks": _schema(
        ("indicator", TEXT, "what is ranked by"),
        ("algorithm", TEXT, "label of the algorithm"),
        ("average_rank", NUMBER, "mean over missions of the rank of its median; 1 is best"),
        ("n_missions", INTEGER, "missions, the blocks of the test"),
        ("statistic", NUMBER, "Friedman's statistic", "where there is no test"),
        ("p_value", NUMBER, "of the Friedman test", "where there is no test"),
        ("note", TEXT, "the outcome in words, or why there is no test"),
    ),
    "summary": lambda: _schema(
        _MISSION,
        ("algorithm", TEXT, "label of the algorithm"),
        ("n", INTEGER, "runs"),
        ("n_not_done", INTEGER, "runs among them that failed, timed out or found nothing feasible"),
        ("area_median", NUMBER, "median area"),
        ("area_low", NUMBER, "lower end of the median's bootstrap confidence interval"),
        ("area_high", NUMBER, "upper end of it"),
        ("area_mean", NUMBER, "mean area"),
        ("area_sd", NUMBER, "standard deviation of the areas", "for a single run"),
        ("area_best", NUMBER, "largest area"),
        (
            "area_share",
            NUMBER,
            "area_mean as a share of that of the reference front",
            "if that is 0",
        ),
        ("area_gap", NUMBER, "share by which area_mean may be exceeded at most", "without bound"),
        *_scores("_median", "median"),
        ("front_size_median", NUMBER, "median number of points on the front"),
        ("rank", NUMBER, "rank of the median area on this mission; 1 is best"),
        ("evaluations_median", NUMBER, "median number of evaluations"),
        ("seconds_median", NUMBER, "median of the algorithm's own time"),
    ),
    "posthoc": _schema(
        ("indicator", TEXT, "what is ranked by"),
        ("algorithm", TEXT, "label of the first algorithm"),
        ("other", TEXT, "label of the second"),
        ("difference", NUMBER, "average rank of the first minus that of the second"),
        ("critical_difference", NUMBER, "what the size of it has to exceed, by Nemenyi"),
        ("p_value", NUMBER, "of the Nemenyi test, which allows for all pairs"),
        ("significant", FLAG, "whether it and Friedman's are below the significance level"),
    ),
    "targets": _schema(
        _MISSION,
        ("algorithm", TEXT, "label of the algorithm"),
        ("share", NUMBER, "share of the area of the mission's reference front: 0.9, 0.95, 0.99"),
        ("target", NUMBER, "the area that this is"),
        ("n", INTEGER, "runs"),
        ("n_reached", INTEGER, "runs with a recorded front of at least this area"),
        ("evaluations_median", NUMBER, "median evaluations to it, of all runs", "if endless"),
        ("seconds_median", NUMBER, "median of the algorithm's own time to it", "if endless"),
    ),
    "missions": _schema(
        _MISSION,
        ("name", TEXT, "its source: a name, a file or module:Class"),
        ("family", TEXT, "label of its entry in the study file, before grids are expanded"),
        ("nodes", INTEGER, "nodes"),
        ("arcs", INTEGER, "arcs"),
        ("robots", INTEGER, "robots of the team"),
        ("total_reward", NUMBER, "sum of the nodes' rewards"),
        *_LIMITS,
        ("bound_area", NUMBER, "area that no front exceeds", "where there is no bound"),
        ("bound_seconds", NUMBER, "how long that bound was computed", "where there is none"),
        further="one for each parameter in a grid; `grid_NAME` where there is a NAME above",
    ),
    "algorithms": _schema(
        ("algorithm", TEXT, "label of the algorithm in the study file"),
        ("name", TEXT, "name by which it is registered, or module:Class"),
        ("family", TEXT, "label of its entry in the study file, before grids are expanded"),
        ("package", TEXT, "package that it is from", "for code of your own"),
        ("version", TEXT, "version of that package", "for code of your own"),
        further="one for each parameter that is given to any, or in which those that have it "
        "differ; `parameter_NAME` where there is a NAME above",
    ),
    "environments": _schema(
        ("environment", TEXT, "digest of the other columns"),
        ("botohe_moo", TEXT, "version of this package"),
        ("commit", TEXT, "commit of its source, with + where it was changed", "if installed"),
        ("python", TEXT, "version"),
        ("packages", TEXT, "versions of the packages that compute, as name==version"),
        ("system", TEXT, "operating system"),
        ("machine", TEXT, "name of the machine"),
        ("processor", TEXT, "model of the processor"),
        ("n_cpus", INTEGER, "processors that may be used"),
        ("threads", TEXT, "settings of thread pools, as NAME=VALUE"),
    ),
}


class _Schemas(Mapping[str, pa.Schema]):
    """The schema of each table; some have columns for the indicators that are registered."""

    def __getitem__(self, name: str) -> pa.Schema:
        schema = _TABLES[name]
        return schema() if callable(schema) else schema

    def __iter__(self) -> Iterator[str]:
        return iter(_TABLES)

    def __len__(self) -> int:
        return len(_TABLES)


SCHEMAS = _Schemas()
