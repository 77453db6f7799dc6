"""The page of the command line, as typer writes it of the program itself."""

import subprocess
import sys
from pathlib import Path

from sphinx.application import Sphinx

COMMAND = ("botohe_moo.cli.app", "utils", "docs", "--name", "botohe")


def write_page(app: Sphinx, _config: object) -> None:
    """Write ``_build/command-line.md``, which the guide includes."""
    target = Path(app.srcdir) / "_build" / "command-line.md"
    target.parent.mkdir(exist_ok=True)
    command = [sys.executable, "-m", "typer", *COMMAND, "--output", str(target)]
    subprocess.run(command, check=True, capture_output=True)


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the page before anything is read."""
    app.connect("config-inited", write_page)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
