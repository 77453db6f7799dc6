"""The tables ``missions`` and ``algorithms``, whose columns depend on the study."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from botohe_moo.mission.model import Mission
from botohe_moo.study.file.digest import value_text
from botohe_moo.study.judge.scores import as_table


def mission_table(manifest: Mapping[str, Any], missions: Mapping[str, Mission]) -> pd.DataFrame:
    """Make the table ``missions``, with a further column for each parameter in a grid."""
    rows = []
    for label, entry in manifest["missions"].items():
        mission = missions[label]
        rows.append(
            {
                "mission": label,
                "name": str(entry["source"]["name_or_path"]),
                "family": entry.get("family", label),
                "nodes": mission.graph.number_of_nodes(),
                "arcs": mission.graph.number_of_edges(),
                "robots": mission.robots,
                "total_reward": mission.total_reward,
                "min_survival": entry["min_survival"],
            }
        )
    varied = [entry.get("grid") or {} for entry in manifest["missions"].values()]
    return _widened("missions", rows, varied, prefix="grid_")


def algorithm_table(manifest: Mapping[str, Any]) -> pd.DataFrame:
    """Make the table ``algorithms``, with a further column for each parameter that is given to any.

    Other algorithms have their default there, if they have such a parameter.
    """
    rows = [
        {
            "algorithm": label,
            "name": entry.get("name", entry["algorithm"]),
            "family": entry.get("family", label),
            "package": entry["package"],
            "version": entry["version"],
        }
        for label, entry in manifest["algorithms"].items()
    ]
    entries = manifest["algorithms"].values()
    given = dict.fromkeys(name for entry in entries for name in entry["parameters"])
    used = [{**entry.get("effective", {}), **entry["parameters"]} for entry in entries]
    shown = [{name: values[name] for name in given if name in values} for values in used]
    return _widened("algorithms", rows, shown, prefix="parameter_")


def _widened(
    name: str, rows: list[dict[str, Any]], parameters: Sequence[Mapping[str, Any]], *, prefix: str
) -> pd.DataFrame:
    """Add a column for each parameter, in the order of appearance."""
    table = as_table(name, rows)
    for parameter in dict.fromkeys(key for given in parameters for key in given):
        column = parameter
        while column in table:
            column = prefix + column
        table[column] = _typed([given.get(parameter) for given in parameters])
    return table


def _typed(values: list[Any]) -> "pd.Series[Any]":
    """Give a column the common type of its values; texts where there is none."""
    kinds = {type(value) for value in values if value is not None}
    if kinds == {bool}:
        return pd.Series(values, dtype="boolean")
    try:
        if kinds == {int}:
            return pd.Series(values, dtype="Int64")
        if kinds and kinds <= {int, float}:
            return pd.Series(values, dtype="float64")
    except OverflowError:  # an integer of more than 64 bits
        pass
    texts = [value if value is None else value_text(value) for value in values]
    return pd.Series(texts, dtype="str")
