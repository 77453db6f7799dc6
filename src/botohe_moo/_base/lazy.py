"""Packages whose names are imported when they are first used."""

import ast
import sys
from collections.abc import Callable
from importlib import import_module
from typing import Any


def lazy_names(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Make the ``__getattr__`` and ``__dir__`` (PEP 562) and the ``__all__`` of a package.

    Its public names are those that its ``__init__`` imports for type checkers, in the form that
    these require of exports: ``from HOME import NAME as NAME``, HOME from the top. They are read
    from its source, so that each is named once.

    Examples
    --------
    >>> get, names, listed = lazy_names("botohe_moo")
    >>> get("TrailPlan").__module__, "TrailPlan" in names(), "TrailPlan" in listed
    ('botohe_moo.trails', True, True)
    """
    loader: Any = sys.modules[package].__loader__
    tree = ast.parse(loader.get_source(package))
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    homes = {
        alias.asname: str(node.module) for node in imports for alias in node.names if alias.asname
    }
    listed = sorted(homes)

    def get(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(homes[name]), name)

    return get, listed.copy, listed
