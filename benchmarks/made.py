"""Which command makes each result, as results/README.md says, and which commit last changed it.

That commit need not be the one that measured: it may have changed a title only.
"""

import re
import subprocess
from pathlib import Path


def commands(results: Path) -> dict[str, str]:
    """Read the commands from the table of results/README.md, by folder."""
    rows = re.findall(r"^\| (.*) \| (.*) \|$", (results / "README.md").read_text("utf-8"), re.M)
    return {name: how for names, how in rows for name in re.findall(r"`([\w-]+)/`", names)}


def folders(results: Path) -> list[str]:
    """List the folders that are committed."""
    files = subprocess.check_output(["git", "ls-files", "."], cwd=results, text=True).split()
    return sorted({file.partition("/")[0] for file in files if "/" in file})


def run(results: Path) -> bool:
    """Print folder, last commit, its date and command; tell whether each folder has a command."""
    known, log = commands(results), ["git", "log", "-1", "--format=%h %as", "--"]
    for folder in folders(results):
        last = subprocess.check_output([*log, folder], cwd=results, text=True).strip()
        print(f"{folder:26}{last:22}{known.get(folder, 'made by hand?')}")
    return known.keys() >= {*folders(results)}
