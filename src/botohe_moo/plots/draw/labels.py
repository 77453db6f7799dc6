"""Texts in pictures: letters that can be drawn, short names that differ, and line breaks."""

import re
import unicodedata
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from functools import cache
from itertools import groupby

from matplotlib import font_manager

BASE = "DejaVu Sans"  # matplotlib brings it along: pictures are the same on every machine

# Fonts with Chinese, Japanese or Korean letters. Only those that are installed are used, since
# matplotlib warns about others.
_OTHERS = """
    Noto Sans CJK SC, Noto Sans CJK JP, Noto Sans CJK TC, Noto Sans CJK KR, Noto Sans SC, Noto
    Sans JP, Noto Sans TC, Noto Sans KR, Source Han Sans SC, Source Han Sans, WenQuanYi Zen Hei,
    WenQuanYi Micro Hei, Droid Sans Fallback, IPAexGothic, IPAGothic, TakaoPGothic, VL PGothic,
    NanumGothic, AR PL UMing CN, PingFang SC, Hiragino Sans, Hiragino Sans GB, Heiti TC, Apple
    SD Gothic Neo, Arial Unicode MS, Microsoft YaHei, SimHei, Yu Gothic, MS Gothic, Malgun
    Gothic, Unifont
"""
_INVISIBLE = ("Cc", "Cf", "Cs", "Zl", "Zp")


@cache
def families() -> tuple[str, ...]:
    """Give the fonts to draw with; a letter is drawn with the first that has it."""
    installed = {entry.name for entry in font_manager.fontManager.ttflist}
    others = " ".join(_OTHERS.split()).split(", ")
    return (BASE, *(name for name in others if name in installed))


def drawable(text: str) -> str:
    r"""Replace letters that no font here has, and invisible ones, by their code points.

    So two texts still differ. White space of any kind becomes a space.

    >>> drawable("tab\there, bell\a")
    'tab here, bell[U+0007]'
    """
    if text.isascii() and text.isprintable():
        return text
    letters = (" " if letter.isspace() else letter for letter in text)
    parts = []
    for there, run in groupby(letters, _has):
        found = list(run)
        codes = " ".join(f"U+{ord(letter):04X}" for letter in found)
        parts.append("".join(found) if there else f"[{codes}]")
    return "".join(parts)


@cache
def _has(letter: str) -> bool:
    if unicodedata.category(letter) in _INVISIBLE:
        return False
    return any(ord(letter) in covered for covered in _covered())


@cache
def _covered() -> tuple[frozenset[int], ...]:
    """Code points of each font; they are read when the first letter beyond ASCII is asked for."""
    found = []
    for name in families():
        path = font_manager.findfont(name, fallback_to_default=False)
        found.append(frozenset(font_manager.get_font(path).get_charmap()))
    return tuple(found)


Pairs = tuple[tuple[str, str], ...]

WIDTH = 32  # columns of a line, as far as words allow
UNBROKEN = 44  # a single word or value gets a line of its own up to here

_GRID = re.compile(r"(?P<family>.*\S) \((?P<pairs>\w[\w.-]*=.*)\)")
_NEXT = re.compile(r", (?=[^\W\d][\w.-]*=)")
_GLUE = "\x00"  # stands for a space that no line may be broken at


def parsed_label(label: str) -> tuple[str, Pairs]:
    """Split the label of a grid's member into the family, and its parameters with their values.

    >>> parsed_label("BO-ACO (n_ants=50, evaporation=0.1)")
    ('BO-ACO', (('n_ants', '50'), ('evaporation', '0.1')))
    >>> parsed_label("random")
    ('random', ())
    """
    found = _GRID.fullmatch(label)
    if found is None:
        return label, ()
    parts = [pair.partition("=") for pair in _NEXT.split(found["pairs"])]
    return found["family"], tuple((key, value) for key, _, value in parts)


def display_names(labels: Iterable[str]) -> dict[str, str]:
    """Give the names of labels in pictures: short, but different.

    Values that all members of a grid share are left out. No value is cut, and names that would look
    alike are numbered.

    >>> display_names(["A (n=1, m=2)", "A (n=3, m=2)", "B"])
    {'A (n=1, m=2)': 'A (n=1)', 'A (n=3, m=2)': 'A (n=3)', 'B': 'B'}
    """
    labels = list(dict.fromkeys(labels))
    members: defaultdict[str, list[Pairs]] = defaultdict(list)
    for label in labels:
        family, pairs = parsed_label(label)
        members[family].append(pairs)
    names = {}
    for label in labels:
        family, pairs = parsed_label(label)
        common = set.intersection(*map(set, members[family])) if len(members[family]) > 1 else set()
        told = [f"{key}={value}" for key, value in pairs if (key, value) not in common]
        names[label] = drawable(f"{family} ({', '.join(told)})" if told else family)
    # If two names are alike now, the whole labels may differ.
    looks = Counter(map(_looks, names.values()))
    return _numbered(
        {
            label: drawable(label) if looks[_looks(name)] > 1 else name
            for label, name in names.items()
        }
    )


def _looks(name: str) -> str:
    """Normalise a name to its look: combined letters, single spaces."""
    return " ".join(unicodedata.normalize("NFC", name).split())


def _numbered(names: dict[str, str]) -> dict[str, str]:
    taken = Counter(map(_looks, names.values()))
    numbered = {}
    for label, name in names.items():
        told, number = name, 0
        while taken[_looks(told)] > (1 if told == name else 0):
            number += 1
            told = f"{name} #{number}"
        taken[_looks(told)] += told != name
        numbered[label] = told
    return numbered


def columns(text: str) -> int:
    """Count the columns of the longest line; Chinese, Japanese and Korean letters take two."""
    wide = ("W", "F")
    return max(
        (sum(1 + (unicodedata.east_asian_width(c) in wide) for c in line))
        for line in text.split("\n")
    )


def wrapped(name: str, width: int = WIDTH, *, longest: int = UNBROKEN) -> str:
    """Break a name into lines of ``width`` columns, at spaces, but not within a value.

    Only words and values of more than ``longest`` columns are broken.

    >>> print(wrapped("BO-ACO (n_ants=50, evaporation=0.04)", 24))
    BO-ACO (n_ants=50,
    evaporation=0.04)
    """
    if columns(name) <= width:
        return name
    family, pairs = parsed_label(name)
    if pairs:
        told = [f"{key}={value}".replace(" ", _GLUE) for key, value in pairs]
        name = f"{family} ({', '.join(told)})"
    words = [part for word in name.split() for part in _broken(word, max(width, longest))]
    return "\n".join(_lines(words, width)).replace(_GLUE, " ")


def _broken(word: str, width: int) -> list[str]:
    parts = [""]
    for letter in word:
        if columns(parts[-1] + letter) > width:
            parts.append("")
        parts[-1] += letter
    return parts


def _lines(words: Sequence[str], width: int) -> list[str]:
    lines = [words[0]]
    for word in words[1:]:
        if columns(lines[-1]) + 1 + columns(word) <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines
