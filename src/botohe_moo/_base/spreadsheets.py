"""Tables in CSV files, as spreadsheets write them."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from botohe_moo._base.source import Source
from botohe_moo._base.types import FilePath

if TYPE_CHECKING:
    import pandas as pd

_SEPARATORS = ",;\t"
FILE, FAULTS = "botohe_moo file", "botohe_moo faults"  # attributes of tables read from files


def read_table(path: FilePath) -> pd.DataFrame:
    """Read a CSV file of texts, whose index is the number of each row in a spreadsheet.

    Cells are separated by commas, semicolons or tabs: by what a first line such as ``sep=;`` says,
    or by what the header has most of. Empty rows are left out, and so are rows with too few or too
    many cells: they are in the attribute `FAULTS`. A ValueError names the file and what is wrong
    with it.
    """
    import pandas as pd

    try:
        text = Source(path).text
    except UnicodeDecodeError as error:
        remedy = "save it as 'CSV UTF-8', as spreadsheets call it"
        raise ValueError(f"{path}: {error}; {remedy}") from None
    first, _, rest = text.lstrip().partition("\n")
    separator = max(_SEPARATORS, key=first.count)
    if (said := first.strip('"\r').lower()) in (f"sep={mark}" for mark in _SEPARATORS):  # of Excel
        text, separator = f"\n{rest}", said[4]
    lines = csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True)
    try:
        rows = {i: cells for i, cells in enumerate(lines, 1) if any(map(str.strip, cells))}
    except csv.Error as error:  # such as a quote that does not end
        raise ValueError(f"{path}: line {lines.line_num}: {error}") from None
    if not rows:
        raise ValueError(f"{path}: expected a first row of column names, found an empty file")
    header = rows.pop(next(iter(rows)))
    whole = {i: cells for i, cells in rows.items() if len(cells) == len(header)}
    table = pd.DataFrame([*whole.values()], pd.Index([*whole], dtype=int), header, dtype=object)
    table.attrs[FILE] = str(path)
    table.attrs[FAULTS] = [
        f"{path}, row {i}: expected {len(header)} cells, as the first row has, found {len(cells)}"
        for i, cells in rows.items()
        if i not in whole
    ]
    return table


def filled_cells(
    frame: pd.DataFrame, names: Sequence[str], table: str
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the place and the non-empty cells of each row; places begin with ``table``.

    Columns have ``names``; one with an empty name is left out. Texts lose the blanks around them.
    """
    cells = frame.astype(object).where(frame.notna(), None)
    for index, *values in cells.itertuples(name=None):
        stripped = (value.strip() or None if isinstance(value, str) else value for value in values)
        filled = zip(names, stripped, strict=True)
        yield f"{table}, row {index}", {key: v for key, v in filled if key and v is not None}
