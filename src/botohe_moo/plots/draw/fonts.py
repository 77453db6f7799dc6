"""Which letters can be drawn on this machine, and what replaces the others."""

from __future__ import annotations

import unicodedata
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

    Examples
    --------
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
