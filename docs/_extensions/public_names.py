"""What parameters of public names are, and references to these names.

A name in a docstring is that of a public object, wherever it is exported from. Types and ranges of
parameters are those that signatures state.
"""

import inspect
import re
from typing import Any, get_type_hints

from docutils import nodes
from numpy.typing import ArrayLike
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.util.nodes import make_refnode

from botohe_moo.base.parameters import signature_parameters, type_text
from exported import documented_names

_ARRAY = re.compile(r"ndarray\[tuple\[Any, \.\.\.\], dtype\[\w+(\[\w+\])?\]\]")


def _type(hint: Any, annotation: str) -> str:
    """Write a type for readers; as it stands where it cannot be resolved."""
    if hint is Any:
        return annotation
    if hint == ArrayLike:
        return "array-like"
    return _ARRAY.sub("ndarray", type_text(hint))


def _types(documented: Any) -> dict[str, str]:
    """Give types and ranges of what a function or a class is given, by name."""
    try:
        stated = list(signature_parameters(documented))
    except (
        TypeError,
        ValueError,
    ):  # a property, or an exception without a constructor of its own has no signature
        stated = []
    parts = {p.name: (_type(p.hint, p.annotation), p.range) for p in stated}
    return {name: ", ".join(filter(None, said)) for name, said in parts.items()}


def state_types(
    _app: Sphinx, _what: str, _name: str, documented: Any, _options: Any, lines: list[str]
) -> None:
    """Put types behind the names in a docstring's sections of parameters and attributes."""
    if not (inspect.isclass(documented) or inspect.isroutine(documented)):
        return
    types = _types(documented)
    section = ""
    for i, line in enumerate(lines):
        if line and set(line) == {"-"}:
            section = lines[i - 1]
        elif section in ("Parameters", "Attributes") and re.fullmatch(r"[\w, ]+", line):
            said = dict.fromkeys(types.get(name, "") for name in line.split(", "))
            if all(said):
                lines[i] = f"{line} : {'; '.join(said)}"


def state_return_type(
    _app: Sphinx,
    what: str,
    _name: str,
    documented: Any,
    _options: Any,
    signature: str,
    _returned: str,
) -> tuple[str, str] | None:
    """Put the type of what a function returns behind its signature."""
    if what not in ("function", "method"):
        return None
    annotation = inspect.signature(documented).return_annotation
    if annotation in (inspect.Signature.empty, None, "None"):
        return None
    try:
        hint = get_type_hints(inspect.unwrap(documented))["return"]
    except NameError:  # imported for type checkers only
        hint = Any
    return signature, _type(hint, str(annotation))


def resolve(
    app: Sphinx, env: BuildEnvironment, node: pending_xref, content: nodes.TextElement
) -> nodes.Element | None:
    """Find what a short name stands for, such as ``Solution.write``."""
    if node.get("refdomain") != "py":
        return None
    first, _, rest = node["reftarget"].partition(".")
    if first not in app.public_names:
        return None
    target = f"{app.public_names[first]}.{rest}".rstrip(".")
    found = env.domains["py"].objects.get(target)
    if found is None:
        return None
    return make_refnode(app.builder, node["refdoc"], found.docname, found.node_id, content, target)


def keep_public_bases(
    app: Sphinx, _name: str, _documented: Any, _options: Any, bases: list[type]
) -> None:
    """Leave out bases that nobody else can derive from."""
    ours = [base for base in bases if base.__module__.startswith("botohe_moo")]
    for base in ours:
        if base.__name__ not in app.public_names:
            bases[bases.index(base) : bases.index(base) + 1] = [
                b for b in base.__bases__ if b.__name__ in app.public_names
            ]


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect all this."""
    app.public_names = documented_names()
    app.connect("autodoc-process-docstring", state_types, priority=400)  # before numpydoc
    app.connect("autodoc-process-signature", state_return_type)
    app.connect("autodoc-process-bases", keep_public_bases)
    app.connect("missing-reference", resolve)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
