"""The guide to studies says what tables hold, and its study file is one."""

import re
from pathlib import Path

import pytest

from botohe_moo.study import SCHEMAS, StudyError, load_study
from botohe_moo.study.file.document import Document

GUIDE = Path(__file__).parents[2] / "docs" / "studies.md"
MARKS = ("<!-- tables: kept by tests/study/test_docs.py -->\n", "<!-- end of tables -->")


def columns():
    """The tables as the guide shows them."""
    lines = []
    for name, schema in SCHEMAS.items():
        lines += [f"\n**{name}**\n", "| column | type | |", "|---|---|---|"]
        for field in schema:
            kind = {"string": "text", "int64": "integer", "double": "number", "bool": "flag"}
            about = field.metadata[b"description"].decode()
            lines.append(f"| `{field.name}` | {kind[str(field.type)]} | {about} |")
        for about in (schema.metadata or {}).values():
            lines.append(f"| *further columns* | | {about.decode()} |")
    return "\n".join(lines).strip() + "\n"


def test_columns_are_documented():
    between = GUIDE.read_text("utf-8").partition(MARKS[0])[2].partition(MARKS[1])[0]
    assert between == columns(), "run `python -m tests.study.test_docs`"


def test_the_study_file_in_the_guide_is_one(tmp_path):
    [text] = re.findall(r"```yaml\n(.*?)```", GUIDE.read_text("utf-8"), re.DOTALL)
    assert Document.parse(text).faults == []
    path = tmp_path / "study.yaml"
    path.write_text(text)
    with pytest.raises(StudyError) as caught:
        load_study(path)
    [fault] = str(caught.value).splitlines()  # nothing but the file that is not there
    assert "sites/mine.json" in fault
    path.write_text(text.replace("sites/mine.json", "toy"))
    assert len(load_study(path).algorithms) == 4


if __name__ == "__main__":
    guide = GUIDE.read_text("utf-8")
    before, after = guide.partition(MARKS[0])[0], guide.partition(MARKS[1])[2]
    GUIDE.write_text(before + MARKS[0] + columns() + MARKS[1] + after, "utf-8")
