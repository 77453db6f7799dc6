"""How large the parts of the package are: modules, functions, parameters and names."""

import ast
from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd

HERE = Path(__file__).parents[1]
MANY = 8  # parameters; a function with more holds two things


def run(folder: Path, before: Path | None = None) -> bool:
    """Print and write the table, for this checkout and for another."""
    checkouts = {"now": HERE} if before is None else {"before": before, "now": HERE}
    rows = [
        {"part": part, "checkout": name, **measured(root / "src" / "botohe_moo", within)}
        for part, within in (("package", "."), ("kernels", "kernels"))
        for name, root in checkouts.items()
    ]
    table = pd.DataFrame(rows).set_index(["part", "checkout"])
    print(table.T.to_string(float_format="{:g}".format))
    table.to_csv(folder / "house.csv")
    return True


def measured(package: Path, within: str) -> dict[str, float]:
    """Measure all modules below a folder of a package."""
    sources = [path.read_text("utf-8") for path in sorted((package / within).rglob("*.py"))]
    trees = [ast.parse(source) for source in sources]
    lengths = [len(source.splitlines()) for source in sources]
    functions = [node for tree in trees for node in ast.walk(tree) if is_function(node)]
    spans = [node.end_lineno - node.lineno + 1 for node in functions]
    parameters = [n_parameters(node) for node in functions]
    names = {name for tree in trees for name in defined_in(tree)}
    uses = Counter(
        name
        for path in package.rglob("*.py")
        for name in used_in(ast.parse(path.read_text("utf-8")))
    )
    return {
        "modules": len(sources),
        "lines": sum(lengths),
        "module length, median": np.median(lengths),
        "module length, 90th percentile": np.percentile(lengths, 90),
        "functions": len(functions),
        "function length, median": np.median(spans),
        "function length, 90th percentile": np.percentile(spans, 90),
        "function length, largest": max(spans),
        "parameters, median": np.median(parameters),
        "parameters, 90th percentile": np.percentile(parameters, 90),
        "parameters, largest": max(parameters),
        f"functions with more than {MANY} parameters": sum(n > MANY for n in parameters),
        "names": len(names),
        "share of names used once": round(sum(uses[name] == 1 for name in names) / len(names), 3),
    }


def is_function(node: ast.AST) -> bool:
    return isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)


def n_parameters(function: ast.FunctionDef) -> int:
    """Count what a caller can give: neither ``self`` nor ``cls``."""
    given = function.args
    listed = [*given.posonlyargs, *given.args, *given.kwonlyargs, given.vararg, given.kwarg]
    names = [arg.arg for arg in listed if arg is not None]
    return len(names) - (names[:1] in (["self"], ["cls"]))


def defined_in(tree: ast.Module) -> list[str]:
    """List the functions and classes that a module defines, and the constants at its top."""
    blocks = [
        node for node in ast.walk(tree) if is_function(node) or isinstance(node, ast.ClassDef)
    ]
    targets = [
        target
        for node in tree.body
        if isinstance(node, ast.Assign | ast.AnnAssign)
        for target in (node.targets if isinstance(node, ast.Assign) else [node.target])
    ]
    names = [target.id for target in targets if isinstance(target, ast.Name)]
    return [name for name in [*names, *(node.name for node in blocks)] if name[:2] != "__"]


def used_in(tree: ast.AST) -> list[str]:
    """List the names that a module reads, as often as it does; importing one is not using it."""
    nodes = [n for n in ast.walk(tree) if isinstance(n, ast.Name | ast.Attribute)]
    read = [node for node in nodes if isinstance(node.ctx, ast.Load)]
    return [node.id if isinstance(node, ast.Name) else node.attr for node in read]
