"""Packages with entry points, as pip would install them."""

import textwrap


def write_package(folder, package, code, entry_points):
    """Write a package of one module into a folder of the search path."""
    module = package.replace("-", "_")
    (folder / f"{module}.py").write_text(textwrap.dedent(code))
    info = folder / f"{module}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(entry_points)


def entries(group, module, **targets):
    """Return the lines of ``entry_points.txt`` of one group."""
    lines = [f"{name.replace('_', '-')} = {module}:{target}" for name, target in targets.items()]
    return "\n".join([f"[botohe_moo.{group}]", *lines])
