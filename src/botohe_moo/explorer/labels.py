"""Labels of nodes as the page shows them, and as its files have them."""

import json
import re
from collections import Counter
from collections.abc import Callable, Hashable, Sequence

from botohe_moo.decide.wishes import label_text
from botohe_moo.mission.formats.nodelink import plain_label

# Characters that change the order in which the text around them is shown.
_CONTROLS = (0x061C, 0x200E, 0x200F, *range(0x202A, 0x202F), *range(0x2066, 0x206A))
_VISIBLE = {control: f"⟨U+{control:04X}⟩" for control in _CONTROLS}
_FROM_RIGHT = re.compile("[\u0590-\u08ff\ufb1d-\ufdff\ufe70-\ufeff\U00010800-\U0001efff]")


def visible(text: str) -> str:
    """Write the controls of the direction of writing as code points.

    >>> visible("a\u202eb")
    'a⟨U+202E⟩b'
    """
    return text.translate(_VISIBLE)


def shown_names(nodes: Sequence[Hashable]) -> list[str]:
    """Names to show, which differ: texts as they are, in quotes where 1 and "1" are both there."""
    names = [str(node) for node in nodes]
    counts = Counter(names)
    shown = [
        label_text(node) if counts[name] > 1 or not name.strip() else name
        for node, name in zip(nodes, names, strict=True)
    ]
    # A text may look like another one in quotes; labels as wishes write them always differ.
    if len({*shown}) < len(shown):
        shown = [label_text(node) for node in nodes]
    return [visible(name) for name in shown]


def file_labels(nodes: Sequence[Hashable]) -> list[object] | None:
    """Labels for files; None if JSON cannot hold them all, or a browser would round one."""
    try:
        labels = [plain_label(node) for node in nodes]
    except ValueError:
        return None
    # To a browser, all numbers are floating-point ones.
    return labels if json.loads(json.dumps(labels), parse_int=float) == labels else None


def isolating(nodes: Sequence[Hashable]) -> Callable[[str], str]:
    """Return a function that isolates labels written from the right in a sentence."""
    labels = [text for node in nodes if _FROM_RIGHT.search(text := visible(label_text(node)))]
    if not labels:
        return visible
    longest_first = sorted(map(re.escape, labels), key=len, reverse=True)
    pattern = re.compile("|".join(longest_first))
    return lambda text: pattern.sub("\u2068\\g<0>\u2069", visible(text))
