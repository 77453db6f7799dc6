"""Files appear complete or stay as they were; damage of those that are read is named."""

import errno
import os
from pathlib import Path

import pytest

from botohe_moo.base.files import check_folder, new_folder, read_table, replace_file


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_a_file_is_written_as_it_is_given_and_keeps_its_permissions(tmp_path):
    path = tmp_path / "plans.json"
    replace_file(path, b"a longer text \r\n\x00\xff")
    assert contents(tmp_path) == {"plans.json": b"a longer text \r\n\x00\xff"}
    path.chmod(0o600)
    replace_file(path, b"new")
    assert contents(tmp_path) == {"plans.json": b"new"}
    assert path.stat().st_mode & 0o777 == 0o600


def test_a_symlink_stays_and_its_file_is_written(tmp_path):
    (tmp_path / "there").mkdir()
    link, broken = tmp_path / "link", tmp_path / "broken"
    (tmp_path / "there" / "plans.json").write_bytes(b"old")
    link.symlink_to("there/plans.json")
    broken.symlink_to(tmp_path / "there" / "new.json")
    for path in (link, broken):
        replace_file(path, b"new")
        assert path.is_symlink()
    assert contents(tmp_path / "there") == {"plans.json": b"new", "new.json": b"new"}


def test_devices_pipes_and_folders_are_refused_and_a_missing_folder_is_named(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "device").symlink_to("/dev/null")
    (tmp_path / "folder").mkdir()
    for name in ("pipe", "device", "folder"):
        with pytest.raises(OSError, match=f"found a .*{name}"):
            replace_file(tmp_path / name, b"new")
    assert Path("/dev/null").is_char_device()
    with pytest.raises(FileNotFoundError, match="no such folder") as raised:
        replace_file(tmp_path / "missing" / "plans.json", b"new")
    assert raised.value.filename == str(tmp_path / "missing")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["device", "folder", "pipe"]


def test_a_folder_without_permission_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda *_: False)  # root may write anywhere
    for refused in (
        lambda: replace_file(tmp_path / "plans.json", b"new"),
        lambda: check_folder(tmp_path / "new" / "folder"),
    ):
        with pytest.raises(OSError, match="Permission denied") as raised:
            refused()
        assert raised.value.filename == str(tmp_path)


@pytest.mark.parametrize(
    ("stage", "failure"),
    [
        ("open", OSError(errno.ENOSPC, "No space left on device")),
        ("fsync", KeyboardInterrupt()),
        ("replace", OSError(errno.ENOSPC, "No space left on device")),
    ],
)
def test_whatever_fails_leaves_the_old_file(tmp_path, monkeypatch, stage, failure):
    path = tmp_path / "plans.json"
    path.write_bytes(b"old")

    def fail(*_, **__):
        raise failure

    with monkeypatch.context() as patched:
        patched.setattr(os if stage == "fsync" else type(path), stage, fail)
        with pytest.raises(type(failure)) as raised:
            replace_file(path, b"new")
    assert contents(tmp_path) == {"plans.json": b"old"}
    if isinstance(failure, OSError):  # which does not name the temporary file
        assert (raised.value.errno, raised.value.filename) == (errno.ENOSPC, str(path))


def test_a_new_folder_is_new_every_time(tmp_path):
    for name in ("run", "run-2", "run-3"):
        assert new_folder(tmp_path / "all" / "run") == tmp_path / "all" / name
    assert len(list((tmp_path / "all").iterdir())) == 3


def test_tables_are_read_as_spreadsheets_write_them(tmp_path):
    lines = ["Label,Reward", "dock,0", "", '"north ""hall""",5', ",", " 7 ,NA"]
    for separator in ",;\t":
        text = "\ufeff" + "\r\n".join(lines).replace(",", separator)
        (tmp_path / "nodes.csv").write_bytes(text.encode())
        table = read_table(tmp_path / "nodes.csv")
        assert list(table.columns) == ["Label", "Reward"]
        assert list(table.index) == [2, 4, 6]  # as a spreadsheet counts them
        assert table.to_numpy().tolist() == [["dock", "0"], ['north "hall"', "5"], [" 7 ", "NA"]]


def test_what_is_wrong_with_a_table_is_named(tmp_path):
    path = tmp_path / "nodes.csv"
    with pytest.raises(ValueError, match=f"^{path}: no such file"):
        read_table(path)
    for data, fault in (
        ("", "No columns"),
        ("label,reward\ndock,0,1\n", "line 2"),
        ('label,reward\ndock,"0\nreef,5\n', "EOF inside string"),
        ("label,reward\ncafé,1\n", "0xe9 .* 'CSV UTF-8'"),
    ):
        path.write_bytes(data.encode("cp1252"))
        with pytest.raises(ValueError, match=f"^{path}: .*{fault}"):
            read_table(path)
