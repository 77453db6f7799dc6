"""What has to hold of tables that were read, for a report to be made of them."""

from collections.abc import Mapping
from typing import Any

import pandas as pd
import pyarrow as pa

from botohe_moo._base.checks import quoted
from botohe_moo.indicators import INDICATORS
from botohe_moo.study.store.schemas import SCHEMAS

# Types of the columns that depend on the study.
FURTHER_TYPES = {kind: kind for kind in (pa.string(), pa.int64(), pa.float64(), pa.bool_())}
FURTHER_TYPES[pa.large_string()] = pa.string()


def schema_fault(name: str, table: pa.Table) -> str:
    """Say what a table should have and has not, by its schema; nothing if it has it all."""
    schema, columns = SCHEMAS[name], table.schema.names
    if columns[: len(schema)] != schema.names or len(set(columns)) < len(columns):
        return f"the columns {', '.join(schema.names)}"
    further = table.schema.types[len(schema) :]
    if further and not (schema.metadata and FURTHER_TYPES.keys() >= set(further)):
        return "no further columns, or of texts, numbers and flags"
    for field, column in zip(schema, table.columns, strict=False):
        if field.type != column.type or (column.null_count and not field.nullable):
            return f"a value of type {field.type} in each row of column {field.name}"
    return ""


def label_fault(name: str, table: pd.DataFrame, manifest: Mapping[str, Any]) -> str:
    """Say which label a table has that is not in the study, or lacks; nothing if all is right."""
    missions, algorithms = manifest["missions"], manifest["algorithms"]
    known = {"mission": missions, "algorithm": algorithms, "other": algorithms}
    known["indicator"] = tuple(INDICATORS)
    for column in [column for column in SCHEMAS[name].names if column in known]:
        if unknown := set(table[column]) - set(known[column]):
            return f"only {column}s of the study in column {column}, found {quoted(min(unknown))}"
    of_all = {"missions": "mission", "algorithms": "algorithm"}
    if name in of_all and sorted(table[of_all[name]]) != sorted(known[of_all[name]]):
        return f"each of the study's {name} once"
    return ""
