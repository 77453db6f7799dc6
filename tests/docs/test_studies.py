"""The pages on studies say what tables hold, and their study files are such."""

import pytest

from botohe_moo.study import SCHEMAS, StudyError, load_study
from tests.docs.guides import DOCS, blocks

TABLES = DOCS / "study-tables.md"
MARKS = ("<!-- tables: kept by tests/docs/test_studies.py -->\n", "<!-- end of tables -->")
FILES = [text for language, text in blocks(DOCS / "studies.md") if language == "yaml"]


def columns():
    """The tables as the page shows them: a column that is as in a table above is only named."""
    lines, shown = [], {}
    for name, schema in SCHEMAS.items():
        said = {column: of.description for column, of in schema.items()}
        new = {column: words for column, words in said.items() if shown.get(column) != words}
        again = ", ".join(f"`{column}`" for column in said if column not in new)
        lines.append(f"\n**{name}**\n")
        lines += [f"As above: {again}.\n"] if again else []
        lines += ["| column | |", "|---|---|"]
        lines += [f"| `{column}` | {words} |" for column, words in new.items()]
        shown |= said
    return "\n".join(lines).strip() + "\n"


def test_columns_are_documented():
    between = TABLES.read_text("utf-8").partition(MARKS[0])[2].partition(MARKS[1])[0]
    assert between == columns(), "run `python -m tests.docs.test_studies`"


@pytest.mark.parametrize("text", FILES)
def test_study_files_of_the_guide_are_such(text, tmp_path, monkeypatch):
    """All but the mission file of the second is there; ants.py is the last block of Python."""
    monkeypatch.syspath_prepend(tmp_path)
    module = [code for language, code in blocks(DOCS / "studies.md") if language == "python"][-1]
    (tmp_path / "ants.py").write_text(module)
    path = tmp_path / "study.yaml"
    path.write_text(text)
    if "sites/mine.json" in text:
        with pytest.raises(StudyError, match=r"^.*sites/mine\.json.*$"):
            load_study(path)
        path.write_text(text.replace("sites/mine.json", "toy"))
    assert len(load_study(path).algorithms) in {3, 4}


if __name__ == "__main__":
    page = TABLES.read_text("utf-8")
    before, after = page.partition(MARKS[0])[0], page.partition(MARKS[1])[2]
    TABLES.write_text(before + MARKS[0] + columns() + MARKS[1] + after, "utf-8")
