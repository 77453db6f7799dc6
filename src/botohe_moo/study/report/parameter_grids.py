"""Grids of two parameters among the algorithms of a study."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["two_parameter_grids"]

_NO_PARAMETERS = {"algorithm", "name", "family", "package", "version"}


def two_parameter_grids(algorithms: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Find families of algorithms in which exactly two parameters vary, and nothing else does.

    Parameters
    ----------
    algorithms
        The study's table ``algorithms``.

    Returns
    -------
    dict
        For each family the labels: rows are values of the first parameter that varies, columns
        those of the second, in ascending order, or in that of the file where they are no numbers;
        None where there is no such algorithm.
    """
    parameters = [column for column in algorithms.columns if column not in _NO_PARAMETERS]
    if algorithms.empty or len(parameters) < 2:
        return {}
    grids = {}
    for family, rows in algorithms.groupby("family", sort=False):
        shown = rows[parameters].astype(object).where(rows[parameters].notna(), "default")
        varying = [name for name in parameters if len(set(shown[name])) > 1]
        if len(varying) == 2 and len(set(rows["name"])) == 1:
            places = zip(*(shown[name] for name in varying), strict=True)
            cells = dict(zip(places, rows["algorithm"], strict=True))
            if len(cells) == len(rows):
                grids[str(family)] = _table(cells, varying)
    return grids


def _table(cells: dict[tuple[Any, Any], str], names: list[str]) -> pd.DataFrame:
    rows, columns = (_ordered(values) for values in zip(*cells, strict=True))
    return pd.DataFrame(
        [[cells.get((row, column)) for column in columns] for row in rows],
        index=pd.Index(rows, name=names[0], dtype=object),
        columns=pd.Index(columns, name=names[1], dtype=object),
        dtype=object,
    )


def _ordered(values: Iterable[Any]) -> list[Any]:
    found = list(dict.fromkeys(values))
    numbers = all(isinstance(value, int | float | np.number) for value in found)
    return sorted(found) if numbers else found
