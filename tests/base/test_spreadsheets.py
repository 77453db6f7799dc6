"""CSV files as spreadsheets write them."""

import pytest

from botohe_moo.base.files import read_table


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_a_file(tmp_path, separator):
    lines = ["Label,Reward", "dock,0", "", '"north ""hall""",5', ",", " 7 ,NA"]
    text = "\ufeff" + "\r\n".join(lines).replace(",", separator)
    (tmp_path / "nodes.csv").write_bytes(text.encode())
    table = read_table(tmp_path / "nodes.csv")
    assert list(table.columns) == ["Label", "Reward"]
    assert list(table.index) == [2, 4, 6]  # as a spreadsheet counts them
    assert table.to_numpy().tolist() == [["dock", "0"], ['north "hall"', "5"], [" 7 ", "NA"]]


@pytest.mark.parametrize(
    ("data", "fault"),
    [
        (None, "no such file"),
        (b"", "No columns to parse from file"),
        (b"label,reward\ndock,0,1\n", "Expected 2 fields in line 2, saw 3"),
        (b'label,reward\ndock,"0\nreef,5\n', "EOF inside string starting at row 1"),
        (
            "label,reward\ncafé,1\n".encode("cp1252"),
            "can't decode byte 0xe9 in position 16.*; save it as 'CSV UTF-8'",
        ),
    ],
)
def test_damage_is_named(tmp_path, data, fault):
    path = tmp_path / "nodes.csv"
    if data is not None:
        path.write_bytes(data)
    with pytest.raises(ValueError, match=fault) as caught:
        read_table(path)
    assert str(caught.value).startswith(str(path))
