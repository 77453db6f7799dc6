"""The average ranks of algorithms by family of missions, in the study of algorithms."""

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd
import seaborn as sns

from botohe_moo.mission.loading import ENTRIES


def run(folder: Path) -> bool:
    """Draw the average ranks of algorithms by family of missions, in the study of algorithms."""
    summary = pd.read_csv(folder / "summary.csv")
    families = summary["mission"].map({name: entry.family for name, entry in ENTRIES.items()})
    table = summary.assign(family=families).pivot_table("rank", "family", "algorithm", sort=False)
    figure, ax = plt.subplots(figsize=(8.5, 4), layout="constrained")
    sns.heatmap(table, annot=True, fmt=".1f", cmap="crest_r", cbar=False, ax=ax)
    ax.set(xlabel="", ylabel="")
    ax.tick_params(axis="x", rotation=30)
    figure.savefig(folder / "ranks.png", dpi=110)
    return True
