"""Changes of tables of texts: CSV and the benchmark format."""

import csv
import io
from random import Random

from tests.fuzz.bits import PATHS

CELLS = [
    *("", " ", "0", "1", "-1", "2", "0.5", "-0.0", "1e308", "1e-300", "1e999", "nan", "inf", "0,5"),
    *("9" * 30, "9" * 5_000, "true", "None", "NA", "a", "dock", "Reef", "é", "😀", "x" * 3_000),
    *('"', "'", "\r", "\n", "\t", "=1+1", "@x", "1_0", "٣", "0x1", "1e5", "\x1b[31m", "\u202e"),
    *("label", "reward", "tail", "head", "survival", "length", "x", "y", "n", "m", "tmax", *PATHS),
]


def change_csv(rng: Random, data: bytes) -> bytes:
    """Give a table with changed cells, rows or columns."""
    rows = list(csv.reader(io.StringIO(data.decode(), newline="")))
    for _ in range(rng.choice((1, 1, 2, 3))):
        _change(rng, rows)
    buffer = io.StringIO()
    writer = csv.writer(
        buffer,
        delimiter=rng.choice(",,,,;\t"),
        lineterminator=rng.choice(("\n", "\n", "\r\n", "\r")),
        quoting=rng.choice((csv.QUOTE_MINIMAL, csv.QUOTE_MINIMAL, csv.QUOTE_ALL)),
    )
    writer.writerows(rows)
    return buffer.getvalue().encode(errors="surrogatepass")


def change_points(rng: Random, data: bytes) -> bytes:
    """Give a text of fields with changed fields, lines or columns."""
    rows = [line.split() for line in data.decode().splitlines()]
    for _ in range(rng.choice((1, 1, 2, 3))):
        _change(rng, rows)
    separator = rng.choice((" ", " ", "\t", ";"))
    return "\n".join(separator.join(row) for row in rows).encode(errors="surrogatepass")


def _change(rng: Random, rows: list[list[str]]) -> None:
    if not rows:
        return
    row = rng.randrange(len(rows))
    column = rng.randrange(max(1, len(rows[row])))
    way = rng.choice(("cell", "cell", "cell", "copy", "drop", "more", "many", "column", "swap"))
    if way == "cell":
        rows[row][column : column + 1] = [rng.choice(CELLS)]
    elif way == "copy":
        rows[row][column : column + 1] = rng.choice(rows)[:1]
    elif way == "drop":
        del rows[row]
    elif way == "more":
        rows[row].insert(column, rng.choice(CELLS))
    elif way == "many":
        rows[row:row] = [list(rows[row]) for _ in range(rng.choice((1, 2, 200)))]
    elif way == "column":
        new = rng.choice(CELLS)
        for cells in rows:
            cells[column : column + rng.choice((0, 1))] = [] if new == "" else [new]
    else:
        other = rng.randrange(len(rows))
        rows[row], rows[other] = rows[other], rows[row]
