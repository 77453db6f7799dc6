"""What holds of every picture: labelled, whole, on the axes that are given, in the theme."""

import inspect
import os
import subprocess
import sys
from itertools import combinations
from xml.etree import ElementTree as ET

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
import seaborn as sns
from matplotlib.text import Text

from botohe_moo import Event, plots, replan, simulate_policy, solve
from botohe_moo.bounds import bound_front
from botohe_moo.plots import save_figure, save_plot
from botohe_moo.plots.style import colours
from tests.plots import made, read
from tests.plots.made import TOY, TOY_PLANS

POINT = pd.DataFrame({"reward": [3.0], "survivors": [3.0]})
PICTURES = {
    "plot_mission": lambda draw, **own: draw(TOY, **own),
    "plot_plan": lambda draw, **own: draw(TOY, TOY_PLANS[2], **own),
    "plot_choices": lambda draw, **own: draw(TOY, TOY_PLANS, k=2, **own),
    "plot_replan": lambda draw, **own: draw(
        replan(TOY, TOY_PLANS[2], [Event("reached", 0, 4)], price=2), **own
    ),
    "plot_scenarios": lambda draw, **own: draw(made.STORMY, TOY_PLANS[2], **own),
    "plot_pheromone": lambda draw, **own: draw(TOY, made.pheromone_of(TOY), **own),
    "plot_front": lambda draw, **own: draw([[7, 1]], TOY, bound=bound_front(TOY), **own),
    "plot_pairs": lambda draw, **own: draw(
        (found := solve("toy", "greedy", problem="least-survival", evaluations=30)).table,
        found.problem_objectives,
        **own,
    ),
    "plot_outcomes": lambda draw, **own: draw(TOY, *TOY_PLANS[1:3], **own),
    "plot_policies": lambda draw, **own: draw(
        simulate_policy(TOY, TOY_PLANS[2], "losses", price=2, missions=20),
        TOY.evaluate(TOY_PLANS),
        **own,
    ),
    "plot_curves": lambda draw, **own: draw(made.trace_of(made.TWO), **own),
    "plot_reached": lambda draw, **own: draw(
        made.trace_of(made.TWO),
        pd.DataFrame(list(made.TWO), columns=["algorithm", "seed"]),
        [0.1, 0.4],
        **own,
    ),
    "plot_areas": lambda draw, **own: draw(*made.areas_of(made.AREAS), **own),
    "plot_ranks": lambda draw, **own: draw(*made.ranks_of(made.RANKS, 1.0), **own),
    "plot_shortfalls": lambda draw, **own: draw(*made.SHORTFALLS, **own),
    "plot_heat": lambda draw, **own: draw(made.MEDIANS, **own),
    "plot_fronts": lambda draw, **own: draw(*made.fronts_of(made.RUNS), reference=POINT, **own),
    "plot_attainment": lambda draw, **own: draw(*made.fronts_of(made.RUNS), **own),
    "plot_attainment_difference": lambda draw, **own: draw(
        *made.fronts_of(made.RUNS), "A", "B", **own
    ),
}
TITLE = "A $<made.site>$"


def draw(name, **own):
    """Draw a picture, and return the first of its axes; it has a title if it can have one."""
    function = getattr(plots, name)
    if "title" in inspect.signature(function).parameters:
        own["title"] = TITLE
    found = PICTURES[name](function, **own)
    return found[0] if isinstance(found, tuple) else found


def texts_of(figure):
    return [text for text in figure.findobj(Text) if text.get_visible() and text.get_text()]


def test_all_are_here():
    assert {*PICTURES, "save_figure", "save_plot", "theme"} == set(plots.__all__)


@pytest.mark.parametrize("name", PICTURES)
def test_axes_are_labelled_and_texts_are_shown_as_they_are(tmp_path, name):
    settings = dict(mpl.rcParams)
    ax = draw(name)
    assert dict(mpl.rcParams) == settings
    figure = ax.figure.figure
    assert len(plt.get_fignums()) == 1
    share, width = read.darkness(ax, tmp_path / "picture.png")
    assert 0.01 < share < 0.7
    assert 200 < width < 1600
    shown = [text.get_text() for text in texts_of(figure)]
    assert any(TITLE in " ".join(text.split()) for text in shown) or name == "plot_pairs"
    for one in figure.axes:
        if one.axison and (one.lines or one.collections or one.patches):
            assert one.get_xlabel() or one.child_axes or one.xaxis.get_ticklabels()
    if ax.axison and name != "plot_ranks":  # which has one axis
        assert ax.get_ylabel() or [t for t in ax.get_yticklabels() if t.get_text()]


@pytest.mark.parametrize(
    "name",
    [n for n in PICTURES if {"ax", "axes"} & {*inspect.signature(getattr(plots, n)).parameters}],
)
def test_own_axes_are_the_only_ones_drawn_on(name):
    many = "axes" in inspect.signature(getattr(plots, name)).parameters
    figure, (mine, second, other) = plt.subplots(1, 3)
    before = len(other.get_children())
    assert draw(name, **({"axes": (mine, second)} if many else {"ax": mine})) is mine
    assert plt.get_fignums() == [figure.number]
    assert figure.axes == [mine, second, other]
    assert len(other.get_children()) == before
    assert other.get_xlim() == (0, 1)


class TestTheme:
    def test_a_theme_or_palette_that_is_set_is_respected(self):
        plain, deep = sns.color_palette("colorblind", 10), sns.color_palette("deep")
        assert colours(10) == [pytest.approx(c) for c in plain]
        with mpl.rc_context():
            sns.set_theme(style="whitegrid", palette="deep")
            ax, points = draw("plot_curves"), draw("plot_areas")
        assert ax.spines["right"].get_visible()  # as whitegrid has it
        cloud = read.of_kind(points, mpl.collections.PathCollection)[0]
        assert tuple(cloud.get_facecolor()[0][:3]) == pytest.approx(deep[0])
        mine = {"A": "red", "B": "lime"}
        for lines, wanted in (
            (read.lines_of(ax), deep),
            (read.lines_of(draw("plot_curves", palette="Set2")), sns.color_palette("Set2", 2)),
            (read.lines_of(draw("plot_curves", palette=mine)), ["red", "lime"]),
        ):
            for label, colour in zip("AB", wanted, strict=False):
                found = mpl.colors.to_rgb(lines[label].get_color())
                assert found == pytest.approx(mpl.colors.to_rgb(colour))
        with pytest.raises(ValueError, match="a colour for every label, missing: B"):
            draw("plot_curves", palette={"A": "red"})

    @pytest.mark.slow
    def test_a_backend_that_draws_at_once_still_does_so_after_the_first_picture(self, tmp_path):
        """As that of notebooks, which shows no figure where matplotlib is not interactive."""
        backend = "import matplotlib\nfrom matplotlib.backends.backend_agg import *\n"
        (tmp_path / "at_once.py").write_text(f"{backend}matplotlib.interactive(True)\n")
        code = (
            "import matplotlib; from botohe_moo import plot_front; plot_front([[1.0, 2.0]]);"
            "print(matplotlib.is_interactive())"
        )
        path = os.pathsep.join([str(tmp_path), *sys.path])
        env = {**os.environ, "MPLBACKEND": "module://at_once", "PYTHONPATH": path}
        command = [sys.executable, "-c", code]
        done = subprocess.run(command, env=env, capture_output=True, text=True, check=True)
        assert done.stdout == "True\n"


class TestSaving:
    def test_whole_files_are_replaced_or_nothing(self, tmp_path, monkeypatch):
        path, ax = tmp_path / "front.png", draw("plot_heat")
        path.write_text("old")

        def fail_half_way(target, **_):
            target.write(b"half")
            raise OSError("disk full")

        with monkeypatch.context() as patch:
            patch.setattr(ax.figure, "savefig", fail_half_way)
            with pytest.raises(OSError, match="disk full"):
                save_figure(ax.figure, path)
        assert path.read_text() == "old"
        assert list(tmp_path.iterdir()) == [path]

    def test_all_formats(self, tmp_path):  # as large as what is drawn, so that nothing is cut off
        paths = [tmp_path / f"picture.{end}" for end in ("png", "pdf", "svg")]
        save_plot(draw("plot_heat"), *paths)
        assert not plt.get_fignums()
        png, pdf, svg = (path.read_bytes() for path in paths)
        assert png.startswith(b"\x89PNG")
        assert pdf.startswith(b"%PDF")
        assert ET.fromstring(svg).tag.endswith("svg")
        with pytest.raises(ValueError, match=r"ends in one of \.png, \.pdf, \.svg; found .*jpg"):
            save_plot(draw("plot_heat"), tmp_path / "a.jpg")


@pytest.mark.parametrize("name", ["plot_curves", "plot_fronts"])
def test_a_long_legend_is_beside_the_plot(name):
    labels = [f"BO-ACO (n_ants={i}, evaporation={e})" for i in range(8) for e in (0.04, 0.1)]
    runs = {(label, seed): [(1, 2), (2, 1 + seed)] for label in labels for seed in (1, 2)}
    given = (made.trace_of(runs),) if name == "plot_curves" else made.fronts_of(runs)
    ax = getattr(plots, name)(*given)
    ax.figure.canvas.draw()
    legend = ax.get_legend()
    assert legend.get_window_extent().x0 >= ax.get_window_extent().x1
    boxes = [text.get_window_extent() for text in legend.get_texts()]
    assert len(boxes) == len(labels)
    assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))
    assert np.ptp([box.x0 for box in boxes]) < 1
