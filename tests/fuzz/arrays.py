"""Changes of npz files: values, types and shapes of arrays, headers, and the archive itself."""

import io
import pickle
import struct
import warnings
import zipfile
import zlib
from collections.abc import Callable
from random import Random
from typing import Any

import numpy as np

from tests.fuzz.trees import change_json

_DTYPES = ["i1", "u8", ">i4", "f4", "f8", "c16", "?", "U5", "S3", "M8[s]", "m8[D]", "V4", "f2"]
_EXTREMES = [0, 1, -1, 2, 127, 2**31 - 1, 2**31, 2**62, -(2**62), 10**9, 5, 1e308, 0.5]
_FLOATS = [np.nan, np.inf, -np.inf, 1e308, -1e308, 5e-324, -0.0, 1e-300]
_SHAPES = [
    *("(1000000000000,)", "(100000000,)", "(-1,)", "()", "(0,)", "(2, 0)", "(1, 2, 3)", "(True,)"),
    *(
        "(1,) * 40",
        "1",
        "None",
        "(1.5,)",
        "(" * 3000,
        "(9223372036854775807, 2)",
        "(2L,)",
        "('a',)",
    ),
]
_DESCRS = [
    *(
        "'<i8'",
        "'<f8'",
        "'|O'",
        "'|V0'",
        "'<U0'",
        "'<U1000000000'",
        "[('a', '<i8')]",
        "'x'",
        "None",
    ),
    *("'<i8', 'extra': 1", "['<i8']", "[('a', '|O')]", "('<f8', (1000, 1000))", "'>f8'", "'|b1'"),
]
_METHODS = [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA]
_TRAP = b"\x80\x04cos\nsystem\n(S'touch x'\ntR."  # what unpickling must never see


def change_npz(rng: Random, data: bytes) -> bytes:
    """Give an npz file with one changed member, or a changed archive."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name = rng.choice(list(members))
    if name == "header.npy" or rng.random() < 0.2:
        name, way = "header.npy", _changed_header
    else:
        way = rng.choice(_WAYS)
    changed = way(rng, members.pop(name))
    if rng.random() < 0.05:
        name = rng.choice(("other.npy", "x", "../../x.npy", "header.npy", "points.npy"))
    pairs = [*members.items(), *([] if changed is None else [(name, changed)])]
    if rng.random() < 0.03:
        pairs.append(rng.choice(pairs))
    if rng.random() < 0.03:
        return _with_bomb(rng, pairs)
    return _packed(pairs, rng.choice(_METHODS) if rng.random() < 0.1 else zipfile.ZIP_DEFLATED)


def _packed(pairs: list[tuple[str, bytes]], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    buffer = io.BytesIO()
    # Two members may have the same name, of which zipfile warns.
    with warnings.catch_warnings(action="ignore"), zipfile.ZipFile(buffer, "w", method) as archive:
        for name, content in pairs:
            archive.writestr(zipfile.ZipInfo(name), content, method)
    return buffer.getvalue()


def _npy(array: Any) -> bytes:
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, np.asarray(array), allow_pickle=True)
    return buffer.getvalue()


def _array(data: bytes) -> Any:
    return np.lib.format.read_array(io.BytesIO(data))


def _changed_header(rng: Random, data: bytes) -> bytes:
    """Change the JSON that says how a run has ended."""
    return _npy(np.frombuffer(change_json(rng, _array(data).tobytes()), np.uint8))


def _other_values(rng: Random, data: bytes) -> bytes:
    array = _array(data).copy()
    extremes = _FLOATS + _EXTREMES if array.dtype.kind == "f" else _EXTREMES
    for _ in range(rng.choice((1, 1, 3)) if array.size else 0):
        with np.errstate(all="ignore"):
            new = np.array(rng.choice(extremes)).astype(array.dtype)
        array[tuple(rng.randrange(size) for size in array.shape)] = new
    return _npy(array)


def _other_dtype(rng: Random, data: bytes) -> bytes:
    array = _array(data)
    with np.errstate(all="ignore"), warnings.catch_warnings(action="ignore"):
        try:
            return _npy(array.astype(rng.choice(_DTYPES)))
        except (TypeError, ValueError):
            return _npy(array.astype(object))


def _other_shape(rng: Random, data: bytes) -> bytes:
    array = _array(data)
    n = rng.randrange(len(array) + 1)
    ways: tuple[Callable[[], Any], ...] = (
        lambda: array[:n],
        lambda: np.concatenate([array, array[:n]]),
        lambda: array.reshape(-1),
        lambda: array[None],
        lambda: array[..., None],
        lambda: array.T,
        lambda: np.float64(n),
        lambda: array[::-1],
        lambda: np.repeat(array, 300, axis=0),
        lambda: array[:0],
    )
    return _npy(rng.choice(ways)())


def _other_npy_header(rng: Random, data: bytes) -> bytes:
    """Claim another type or shape than there is."""
    array = _array(data)
    shape = rng.choice([str(array.shape), *_SHAPES])
    descr = rng.choice([repr(array.dtype.str), *_DESCRS])
    order = rng.choice(("False", "False", "True", "None", "f()"))
    text = f"{{'descr': {descr}, 'fortran_order': {order}, 'shape': {shape}, }}"
    text = rng.choice((text, text, text, text[: rng.randrange(len(text))], text + "\\\n'''", "é"))
    header = text.encode("latin1", errors="replace")
    version = rng.choice(((1, 0), (1, 0), (2, 0), (3, 0), (9, 9)))
    size = struct.pack("<H" if version == (1, 0) else "<I", len(header))
    return b"\x93NUMPY" + bytes(version) + size + header + array.tobytes()


def _objects(rng: Random, data: bytes) -> bytes:
    header = b"{'descr': '|O', 'fortran_order': False, 'shape': (1,), }"
    plain = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + _TRAP
    return rng.choice((plain, _TRAP, pickle.dumps([1])))


def _no_member(rng: Random, data: bytes) -> None:
    return None


_WAYS: tuple[Callable[[Random, bytes], bytes | None], ...] = (
    *(_other_values, _other_values, _other_dtype, _other_shape, _other_npy_header),
    *(_objects, _no_member),
)


def _with_bomb(rng: Random, pairs: list[tuple[str, bytes]]) -> bytes:
    """Make an archive whose one member is gigabytes of zeros, in some kilobytes."""
    name, n_mib = rng.choice(pairs)[0], rng.choice((64, 4_000))
    n_bytes = n_mib * 2**20
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({n_bytes // 8},), }}".encode()
    begin = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    first = packer.compress(begin) + packer.flush(zlib.Z_FULL_FLUSH)
    block = packer.compress(bytes(2**20)) + packer.flush(zlib.Z_FULL_FLUSH)
    last = packer.flush(zlib.Z_FINISH)
    stored = first + block * n_mib + last
    size = min(len(begin) + n_bytes, 2**32 - 2)
    others = _packed([pair for pair in pairs if pair[0] != name])
    return _appended(others, name.encode(), stored, size)


def _appended(archive: bytes, name: bytes, stored: bytes, size: int) -> bytes:
    """Add a deflated member, whose checksum is wrong, to an archive."""
    with zipfile.ZipFile(io.BytesIO(archive)) as read:
        start, n_members = read.start_dir, len(read.namelist())
    directory = archive[start : archive.rindex(b"PK\5\6")]
    fields = (20, 0, zipfile.ZIP_DEFLATED, 0, 33, 0, len(stored), size, len(name), 0)
    local = struct.pack("<4s5H3I2H", b"PK\3\4", *fields) + name + stored
    entry = struct.pack("<4sH5H3I5H2I", b"PK\1\2", 20, *fields, 0, 0, 0, 0, start) + name
    directory += entry
    where = start + len(local)
    end = struct.pack(
        "<4s4H2IH", b"PK\5\6", 0, 0, n_members + 1, n_members + 1, len(directory), where, 0
    )
    return archive[:start] + local + directory + end
