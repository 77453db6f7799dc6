"""The public names: which there are, and where each is documented."""

import ast
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import botohe_moo

PACKAGE = Path(botohe_moo.__file__).parent


def public_modules() -> list[str]:
    """List the modules that say what they export, those of the command line aside."""
    found = []
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        if parts[0] != "cli" and "__all__" in _assigned(ast.parse(path.read_text("utf-8"))):
            found.append(".".join(["botohe_moo", *parts]).removesuffix(".__init__"))
    return sorted(found, key=lambda name: (name.count("."), name))


def _assigned(tree: ast.Module) -> Iterator[str]:
    """Give the names that a module assigns at its top."""
    for statement in tree.body:
        for target in statement.targets if isinstance(statement, ast.Assign) else []:
            yield from (node.id for node in ast.walk(target) if isinstance(node, ast.Name))


def documented_names() -> dict[str, str]:
    """Give for each public name the one dotted name under which it is documented."""
    documented: dict[str, str] = {}
    for module in public_modules():
        for name in import_module(module).__all__:
            documented.setdefault(name, f"{module}.{name}")
    return documented
