"""Changes of XML: elements, attributes, and what comes before the first element."""

import copy
from random import Random
from xml.etree import ElementTree as ET

from tests.fuzz.bits import OUTSIDE, PATHS

_LAUGHS = "<!DOCTYPE g [<!ENTITY a0 'x'>{}]>".format(
    "".join(f"<!ENTITY a{i} '{f'&a{i - 1};' * 10}'>" for i in range(1, 12))
)
PROLOGS = [
    *("", "<?xml version='1.0'?>", "<?xml version='1.1'?>", "<?xml version='2.0'?>", "\ufeff", " "),
    *("<?xml version='1.0' encoding='UTF-16'?>", "<?xml version='1.0' encoding='x'?>", "<?php ?>"),
    *("<?xml version='1.0' encoding='latin-1'?>", "<?xml version='1.0' encoding='cp1140'?>", "x"),
    *("<?xml version='1.0' encoding='utf-7'?>", "<!-- -->", "<?xml version='1.0' encoding=''?>"),
    *(_LAUGHS, "<!DOCTYPE g>", f"<!DOCTYPE g SYSTEM 'file://{OUTSIDE}/x'>", "<!DOCTYPE g [", "<!"),
    f"<!DOCTYPE g [<!ENTITY e SYSTEM 'file://{OUTSIDE}/x'>]>",
    f"<!DOCTYPE g [<!ENTITY % p SYSTEM '{OUTSIDE}/x'> %p;]>",
]
TEXTS = [
    *("", " ", "0", "1", "-1", "2", "0.5", "1e308", "1e999", "nan", "inf", "-inf", "9" * 30),
    *("9" * 5_000, "true", "false", "yes", "a", "b", "pier", "é", "😀", "x" * 3_000, "1_0", "٣"),
    *("string", "double", "long", "boolean", "int", "float", "all", "node", "edge", "graph", "x"),
    *(
        "pos",
        "id",
        "source",
        "reward",
        "survival",
        "base",
        "robots",
        "length",
        "max_length",
        *PATHS,
    ),
]
TEXTS = [text.replace("\0", "") for text in TEXTS]
NAMES = [
    "id",
    "for",
    "attr.name",
    "attr.type",
    "key",
    "source",
    "target",
    "edgedefault",
    "directed",
]
TAGS = ["graph", "node", "edge", "key", "data", "default", "hyperedge", "port", "graphml", "x"]


def change_xml(rng: Random, data: bytes) -> bytes:
    """Give an XML text with changed elements."""
    root = ET.fromstring(data)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        _change(rng, root)
    written: str = ET.tostring(root, encoding="unicode")
    if rng.random() < 0.15:
        written = rng.choice(PROLOGS) + written
        if rng.random() < 0.5:
            written = written.replace(">0.5<", ">&a11;&e;<").replace('"1"', '"&a11;"', 1)
    if rng.random() < 0.02:
        return written.encode("utf-16")
    return written.encode(errors="surrogatepass")


def _change(rng: Random, root: ET.Element) -> None:
    pairs = [(parent, child) for parent in root.iter() for child in parent]
    if not pairs:
        return
    parent, element = rng.choice(pairs)
    namespace = root.tag.rpartition("}")[0]
    names = [*element.attrib, rng.choice(NAMES)]
    way = rng.choice(("attribute", "attribute", "text", "text", "tag", "drop", "name", "more"))
    if way == "attribute":
        element.set(rng.choice(names), _text(rng, root))
    elif way == "text":
        element.text = _text(rng, root)
    elif way == "tag":
        element.tag = rng.choice((namespace + "}" if namespace else "", "")) + rng.choice(TAGS)
    elif way == "drop":
        parent.remove(element)
    elif way == "name":
        element.attrib.pop(names[0], None)
    else:
        _more(rng, root, parent, element)


def _more(rng: Random, root: ET.Element, parent: ET.Element, element: ET.Element) -> None:
    """Repeat an element, move it, or wrap it in others."""
    way = rng.choice(("again", "many", "elsewhere", "deep"))
    if way == "elsewhere":
        rng.choice(list(root.iter())).append(copy.deepcopy(element))
    elif way == "deep":
        for _ in range(rng.choice((3, 200))):  # deeper ones cannot be written; see bits.TOKENS
            outer = ET.Element(element.tag, element.attrib)
            outer.append(element)
            element = outer
        parent.append(element)
    else:
        parent.extend([copy.deepcopy(element)] * (1 if way == "again" else 300))


def _text(rng: Random, root: ET.Element) -> str:
    if rng.random() < 0.6:
        return rng.choice(TEXTS)
    other = rng.choice(list(root.iter()))
    return rng.choice([other.text or "", *other.attrib.values()])
