"""Text in LaTeX: characters that pdflatex prints, line breaks, and widths."""

import re
import unicodedata

_SPECIAL = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "$": r"\$",
    "&": r"\&",
    "#": r"\#",
    "%": r"\%",
    "_": r"\_",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r"\textquotedbl{}",
    "[": "{[}",  # after the end of a row it would begin an option
    "]": "{]}",
    "-": "{-}",  # two would become a dash
    "`": r"\textasciigrave{}",
    "'": r"\textquotesingle{}",
    "–": "--",
    "—": "---",
    "°": r"\textdegree{}",
    "²": r"\texttwosuperior{}",
    "³": r"\textthreesuperior{}",
    "\n": " ",
    "\t": " ",
    "\xa0": " ",
}
_MATHEMATICS = {
    "−": "-",
    "×": r"\times",
    "·": r"\cdot",
    "±": r"\pm",
    "÷": r"\div",
    "≤": r"\leq",
    "≥": r"\geq",
    "≠": r"\neq",
    "≈": r"\approx",
    "∞": r"\infty",
    "→": r"\rightarrow",
    "←": r"\leftarrow",
    "∈": r"\in",
    "µ": r"\mu",
    "ς": r"\varsigma",
}
# Greek letters are named after their commands, but capitals that look Latin have none.
_GREEK = re.compile(r"GREEK (SMALL|CAPITAL) LETTER ([A-Z]+)")
_CAPITALS = {"gamma", "delta", "theta", "lamda", "xi", "pi", "sigma", "upsilon", "phi", "psi"}
_CAPITALS |= {"omega"}
# The part of Latin-1 and Latin Extended-A that fonts in T1 encoding have.
_LATIN = {chr(code) for code in (0xA1, 0xA3, 0xAB, 0xBB, 0xBF, *range(0xC0, 0x17F))}
_LATIN -= {chr(code) for code in (0x126, 0x127, 0x138, 0x13F, 0x140, 0x149)}
_LATIN |= set("‘’“”‚„")

_BREAK = r"\allowbreak{}"
# After punctuation and in long words, never within a number.
_BREAKS = re.compile(
    r"(?<=[;:/_])(?=\S)|(?<=[-,.])(?=[^\W\d])|(?<==)(?=\S{9})"
    r"|(?<=[^\W\d_]{8})(?=[^\W\d_])|(?<=[^\W_]{7}[^\W\d_])(?=\d)"
)
_NARROW, _WIDE = frozenset(" .,:;'|!()[]/-ijlt"), frozenset("mwMW%@&")


def escape_latex(text: str) -> str:
    """Write a text so that pdflatex prints it unchanged.

    Characters that its fonts lack, such as Chinese ones, are written as code points,
    {[}U+7F8E 672F{]}, so that labels still differ.
    """
    written: list[str] = []
    foreign: list[str] = []
    for character in [*unicodedata.normalize("NFC", text), ""]:
        known = _escaped(character)
        if known is None:
            foreign.append(f"{ord(character):04X}")
            continue
        if foreign:
            written.append(f"{{[}}U+{' '.join(foreign)}{{]}}")
            foreign.clear()
        written.append(known)
    return "".join(written)


def _escaped(character: str) -> str | None:
    """Write a character; None if the fonts lack it."""
    if character in _SPECIAL:
        return _SPECIAL[character]
    if character in _LATIN or (character.isascii() and character.isprintable()) or not character:
        return character
    command = _MATHEMATICS.get(character) or _greek(character)
    return f"\\ensuremath{{{command}}}" if command else None


def _greek(character: str) -> str | None:
    match = _GREEK.fullmatch(unicodedata.name(character, ""))
    if match is None:
        return None
    name = match[2].lower()
    if (match[1] == "CAPITAL" and name not in _CAPITALS) or name == "omicron":
        return None
    name = {"lamda": "lambda"}.get(name, name)
    return "\\" + (name.capitalize() if match[1] == "CAPITAL" else name)


def breakable(text: str) -> str:
    """Write a text that may break after punctuation and within long words."""
    pieces = _BREAKS.split(unicodedata.normalize("NFC", text))
    return _BREAK.join(map(escape_latex, pieces))


def width(text: str) -> float:
    """Estimate the width in em of a text of digits and plain words; a digit has half an em."""
    return sum(0.29 if c in _NARROW else 0.83 if c in _WIDE else 0.5 for c in text)
