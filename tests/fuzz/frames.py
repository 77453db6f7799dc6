"""Changes of Parquet files: columns, their types, their values and their rows."""

import io
from random import Random

import pyarrow as pa
import pyarrow.parquet as pq

_TYPES = [pa.string(), pa.int64(), pa.float64(), pa.bool_(), pa.binary(), pa.int8(), pa.null()]
_TEXTS = ["", "toy", "x" * 3_000, "é", "\0", "[[1], [1]]", "[[", "../../x", "nan", "1", "<b>", "\\"]
_NUMBERS = [0, 1, -1, 10**6, 2**62, -(2**62)]
_FLOATS = [0.0, -1.0, 1e308, -1e308, float("nan"), float("inf"), -float("inf"), 5e-324]


def change_parquet(rng: Random, data: bytes) -> bytes:
    """Give a table with a change of a column, or of its rows."""
    table = pq.read_table(pa.BufferReader(data), use_threads=False)
    for _ in range(rng.choice((1, 1, 2))):
        table = _changed(rng, table)
    buffer = io.BytesIO()
    pq.write_table(table, buffer, compression=rng.choice(("zstd", "snappy", "none")))
    return buffer.getvalue()


def _changed(rng: Random, table: pa.Table) -> pa.Table:
    way = rng.choice(("value", "value", "value", "type", "drop", "name", "more", "rows", "column"))
    if not table.num_columns:
        return table
    i = rng.randrange(table.num_columns)
    name, column = table.column_names[i], table.column(i)
    if way == "value":
        return table.set_column(i, name, _values(rng, column))
    if way == "type":
        return table.set_column(i, name, _cast(rng, column))
    if way == "drop":
        return table.remove_column(i)
    if way == "name":
        names = list(table.column_names)
        names[i] = rng.choice(("", "x", "run", "mission", "area", *names))
        return table.rename_columns(names)
    if way == "more":
        return table.append_column(rng.choice(("x", name)), column)
    if way == "rows":
        n = rng.randrange(table.num_rows + 1)
        ways = (table.slice(n), table.slice(0, n), table.slice(0, 0), [table] * 2, [table] * 200)
        new = rng.choice(ways)
        return pa.concat_tables(new) if isinstance(new, list) else new
    nested = [[1]] * table.num_rows if rng.random() < 0.5 else [{"a": 1}] * table.num_rows
    return table.set_column(i, name, pa.array(nested))


def _values(rng: Random, column: pa.ChunkedArray) -> pa.Array:
    values = column.to_pylist()
    kind = column.type
    new: list[object] = [None]
    if pa.types.is_string(kind) or pa.types.is_large_string(kind):
        new += _TEXTS + values
    elif pa.types.is_integer(kind):
        new += _NUMBERS
    elif pa.types.is_floating(kind):
        new += _FLOATS
    elif pa.types.is_boolean(kind):
        new += [True, False]
    one = rng.choice(new)
    for i in range(len(values)) if rng.random() < 0.2 else [rng.randrange(len(values) or 1)]:
        values[i : i + 1] = [one] if values else []
    try:
        return pa.array(values, kind)
    except (pa.ArrowException, OverflowError):
        return column


def _cast(rng: Random, column: pa.ChunkedArray) -> pa.Array:
    kind = rng.choice(_TYPES)
    try:
        return column.cast(kind)
    except pa.ArrowException:
        return pa.nulls(len(column), kind)
