"""A file appears complete or stays as it was, and nothing else is left behind."""

import errno
import os
from pathlib import Path

import pytest

from botohe_moo.base.files import Source, new_folder, read_json, replace_file


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_a_new_file(tmp_path):
    replace_file(tmp_path / "plans.json", b"[]\r\n\x00\xff")
    assert contents(tmp_path) == {"plans.json": b"[]\r\n\x00\xff"}


def test_a_file_is_replaced(tmp_path):
    path = tmp_path / "plans.json"
    path.write_bytes(b"a longer text than the new one")
    replace_file(path, b"new")
    assert contents(tmp_path) == {"plans.json": b"new"}


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


def test_devices_pipes_and_folders_are_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "device").symlink_to("/dev/null")
    (tmp_path / "folder").mkdir()
    for name, found in (("pipe", "pipe"), ("device", "device"), ("folder", "folder")):
        with pytest.raises(OSError, match=f"found a .*{found}"):
            replace_file(tmp_path / name, b"new")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["device", "folder", "pipe"]
    assert Path("/dev/null").is_char_device()


def test_permissions_stay(tmp_path):
    path = tmp_path / "secret.json"
    path.write_bytes(b"old")
    path.chmod(0o600)
    replace_file(path, b"new")
    assert path.stat().st_mode & 0o777 == 0o600


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

    owner = os if stage == "fsync" else type(path)
    with monkeypatch.context() as patched:
        patched.setattr(owner, stage, fail)
        with pytest.raises(type(failure)) as raised:
            replace_file(path, b"new")
    assert contents(tmp_path) == {"plans.json": b"old"}
    if isinstance(failure, OSError):
        assert (raised.value.errno, raised.value.filename) == (errno.ENOSPC, str(path))
        assert str(raised.value) == f"[Errno {errno.ENOSPC}] No space left on device: {str(path)!r}"


def test_a_missing_folder(tmp_path):
    path = tmp_path / "missing" / "plans.json"
    with pytest.raises(FileNotFoundError) as raised:
        replace_file(path, b"new")
    assert raised.value.filename == str(path.parent)
    assert raised.value.strerror == "there is no such folder"
    assert contents(tmp_path) == {}


class TestJson:
    def test_a_key_that_stands_twice_is_refused(self, tmp_path):
        path = tmp_path / "site.json"
        path.write_text('{"nodes": [{"reward": 1, "id": "reef", "reward": 2}]}')
        said = "^expected each key of an object once, found 'reward' twice$"
        with pytest.raises(ValueError, match=said):
            Source(path).json  # noqa: B018
        assert read_json('{"a": {"b": 1}, "b": [{"a": 2}]}') == {"a": {"b": 1}, "b": [{"a": 2}]}

    def test_what_is_not_json(self):
        with pytest.raises(ValueError, match=r"^Expecting value: line 1 column 7"):
            read_json('{"a": }')


class TestNewFolder:
    def test_it_is_new_every_time(self, tmp_path):
        for name in ("run", "run-2", "run-3"):
            assert new_folder(tmp_path / "all" / "run") == tmp_path / "all" / name
        assert len(list((tmp_path / "all").iterdir())) == 3
