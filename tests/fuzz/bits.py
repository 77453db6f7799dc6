"""Changes of bytes and of words, which need not know what a file holds."""

import re
from random import Random

# Stands for a folder beside that of an input: nothing may be written there.
OUTSIDE = "@OUTSIDE@"

PATHS = ["../../x", "../../../../x.json", "..", ".", f"{OUTSIDE}/x", f"{OUTSIDE}/x.json"]
PATHS += ["/dev/zero", "/dev/null", "~/x", "a/../../b", "x\0y", "C:\\x", "missing.json", "/"]

TOKENS = [
    *(
        b"",
        b"\0",
        b"\xff",
        b"\xfe\xff",
        b"\xef\xbb\xbf",
        b"\xc2\x85",
        b"\xe2\x80\xa8",
        b"\r",
        b"\n",
    ),
    *(
        b"\x1b[31m",
        b"\xed\xa0\x80",
        b"\xf0\x9f\x98\x80",
        b"0",
        b"-1",
        b"1e999",
        b"nan",
        b"Infinity",
    ),
    *(b"9" * 30, b"9" * 5000, b"-0.0", b"0x10", b"1_0", b"\xd9\xa1", b"x" * 3000, b"null", b"true"),
    *(b"[", b"]", b"{", b"}", b'"', b"'", b",", b":", b";", b"\t", b"<", b">", b"&", b"#", b"*a"),
    *(
        b"[" * 3000,
        b'{"a":' * 3000,
        b"<a>" * 3000,
        b"&x;",
        b"]]>",
        b"<![CDATA[",
        b"<!--",
        b"\\ud800",
    ),
    *(path.encode() for path in PATHS),
]
_WORD = re.compile(rb"[^\s\[\]{},:;<>=\"']+")
_SIZES = [0, 1, 1, 1, 2, 4, 8, 20, 100]
_EDGES = [0, 1, 2**7, 2**8 - 1, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1, 2**63, 2**64 - 1]


def change_bytes(rng: Random, data: bytes) -> bytes:
    """Give a file with one change of its bytes."""
    at, size = rng.randrange(len(data) + 1), rng.choice(_SIZES)
    end = min(len(data), at + size)
    other = rng.randrange(len(data) + 1)
    way = rng.choice(("flip", "cut", "put", "put", "replace", "copy", "number", "end", "repeat"))
    if way == "flip" and at < len(data):
        return data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]
    if way == "cut":
        return data[:at] + data[end:]
    if way == "put":
        return data[:at] + rng.choice(TOKENS) + data[at:]
    if way == "replace":
        return data[:at] + rng.randbytes(end - at) + data[end:]
    if way == "copy":
        return data[:other] + data[at:end] + data[other:]
    if way == "number":
        width = rng.choice((1, 2, 4, 8))
        number = rng.choice(_EDGES) % 256**width
        return (
            data[:at] + number.to_bytes(width, rng.choice(("little", "big"))) + data[at + width :]
        )
    if way == "end":
        return data[:at]
    return data[:at] + data[at:end] * rng.choice((2, 3, 500)) + data[end:]


def change_words(rng: Random, data: bytes) -> bytes:
    """Give a text with a word or a line that is replaced, moved or repeated."""
    words, lines = list(_WORD.finditer(data)), data.split(b"\n")
    if rng.random() < 0.7 and words:
        word = rng.choice(words)
        other = rng.choice(TOKENS) if rng.random() < 0.6 else rng.choice(words).group()
        return data[: word.start()] + other + data[word.end() :]
    here, there = rng.randrange(len(lines)), rng.randrange(len(lines))
    way = rng.choice(("drop", "move", "repeat", "many", "indent"))
    if way == "drop":
        del lines[here]
    elif way == "move":
        lines.insert(there, lines.pop(here))
    elif way == "indent":
        lines[here] = rng.choice((b"", b"  ", b"\t")) + lines[here].lstrip()
    else:
        lines[here:here] = [lines[here]] * (1 if way == "repeat" else 300)
    return b"\n".join(lines)
