"""Names in pictures: nothing that tells algorithms apart is lost, whatever the labels are."""

from __future__ import annotations

import warnings

import matplotlib as mpl
import matplotlib.pyplot as plt
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from botohe_moo.mission import Mission
from botohe_moo.plots import algorithm_styles, plot_front, plot_mission, save_figure
from botohe_moo.plots.draw import labels as texts
from botohe_moo.plots.draw.labels import columns, display_names, drawable, parsed_label, wrapped
from tests.plots.test_plots import make


@pytest.fixture(autouse=True)
def _close_figures():
    mpl.use("Agg")
    yield
    plt.close("all")


values = st.one_of(
    st.integers(0, 10**6).map(str),
    st.floats(0, 1).map(repr),
    st.sampled_from(["safest-path", "true", "null", "[1, 2]", '{"a": 1, "b": 2}', "two words"]),
)
keys = st.sampled_from(["n_ants", "evaporation", "repair", "exploration", "p2"])
grids = st.builds(
    lambda family, pairs: f"{family} ({', '.join(f'{k}={v}' for k, v in pairs.items())})",
    st.sampled_from(["BO-ACO", "NSGA-II (fast)", "A, b=1"]),
    st.dictionaries(keys, values, min_size=1, max_size=4),
)
letters = st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=50)
labels = st.lists(st.one_of(grids, letters), min_size=1, max_size=8, unique=True)


def unbroken(text):
    return " ".join(text.split())


class TestDisplayNames:
    def test_a_grid_keeps_what_differs(self):
        grid = [
            f"BO-ACO (n_ants={n}, evaporation={e}, q=1)" for n in (50, 500) for e in (0.04, 0.1)
        ]
        assert list(display_names([*grid, "random"]).values()) == [
            "BO-ACO (n_ants=50, evaporation=0.04)",
            "BO-ACO (n_ants=50, evaporation=0.1)",
            "BO-ACO (n_ants=500, evaporation=0.04)",
            "BO-ACO (n_ants=500, evaporation=0.1)",
            "random",
        ]

    def test_the_label_that_was_cut_is_whole(self):
        grid = [f"BO-ACO (n_ants={n}, evaporation={e})" for n in (50, 100) for e in (0.04, 0.1)]
        for label, style in algorithm_styles(grid).items():
            assert style.name == label
            assert unbroken(wrapped(style.name)) == label
            assert all("=" in line.split()[-1] for line in wrapped(style.name).split("\n"))

    @example(["A (a=1, b=2)", "A (b=2, a=1)"])
    @example(["A", "A (a=1)"])
    @example(["a b", "a  b", "a b #1"])
    @example(["漢字", "[U+6F22 U+5B57]"])
    @example(["e\u0301", "\u00e9"])
    @given(labels)
    def test_distinct_ones_stay_distinct(self, labels):
        names = display_names(labels)
        assert list(names) == labels
        assert len(set(names.values())) == len(labels)
        # Also for who looks at them: spaces and lines are not told apart.
        assert len({unbroken(wrapped(name)) for name in names.values()}) == len(labels)

    @given(labels)
    def test_every_value_that_differs_is_shown_whole(self, labels):
        names = display_names(labels)
        parsed = {label: parsed_label(label) for label in labels}
        for label, (family, pairs) in parsed.items():
            like = [dict(others) for head, others in parsed.values() if head == family]
            for key, value in pairs:
                if any(other.get(key) != value for other in like):
                    told = drawable(f"{key}={value}")
                    assert told in names[label]
                    # On one line, too, unless it is longer than any line.
                    if columns(told) <= 44:
                        assert any(told in line for line in wrapped(names[label]).split("\n"))

    @given(labels, st.integers(8, 40))
    def test_lines_lose_nothing_and_fit(self, labels, width):
        for name in display_names(labels).values():
            lines = wrapped(name, width).split("\n")
            assert "".join("".join(lines).split()) == "".join(name.split())
            assert all(columns(line) <= width or " " not in line or "=" in line for line in lines)
            assert max(map(columns, lines)) <= 44

    @given(labels)
    def test_labels_that_are_not_cut_are_those_of_the_study(self, labels):
        for label, name in display_names(labels).items():
            if not parsed_label(label)[1] and label.isascii():
                assert name.startswith(label)


class TestDrawable:
    def test_latin_greek_and_cyrillic_stay(self):
        for text in ("BO-ACO", "Zürich – Łódź", "αβγ", "Москва", "a−b × c"):
            assert drawable(text) == text

    def test_what_no_font_has_is_told_by_its_code(self, monkeypatch):
        only_latin = (frozenset(range(32, 0x250)),)
        monkeypatch.setattr(texts, "_covered", lambda: only_latin)
        texts._has.cache_clear()
        try:
            assert drawable("漢字 2") == "[U+6F22 U+5B57] 2"
            assert drawable("a漢b字") == "a[U+6F22]b[U+5B57]"
        finally:
            texts._has.cache_clear()

    def test_what_cannot_be_seen_is_told(self):
        assert drawable("a\u200bb") == "a[U+200B]b"
        assert drawable("a\u202eb\x07") == "a[U+202E]b[U+0007]"
        assert drawable("a\u00a0b\tc") == "a b c"

    def test_fonts_that_are_not_installed_are_not_asked_for(self):
        installed = {entry.name for entry in mpl.font_manager.fontManager.ttflist}
        assert set(texts.families()) <= installed
        assert texts.families()[0] == "DejaVu Sans"

    @given(st.text(max_size=20))
    def test_every_letter_can_be_drawn(self, text):
        shown = drawable(text)
        assert all(texts._has(letter) for letter in shown)
        assert drawable(shown) == shown

    def test_a_mission_with_any_labels_is_drawn_without_a_warning(self, tmp_path):
        nodes = {n: {"reward": 1, "zone": zone} for n, zone in (("港", "一"), ("島", "二"))}
        mission = make(nodes, [("港", "島", 0.9), ("島", "港", 0.9)], base="港")
        graph = mission.graph.copy()
        graph.graph["title"] = "島々"
        titled = Mission(graph, base="港", robots=1)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            ax = plot_mission(titled, titled.plan([["港", "島", "港"]]))
            save_figure(ax.figure, tmp_path / "mission.png", tmp_path / "mission.pdf")
            ax = plot_front([[1, 1]], titled, label="漢字")
            save_figure(ax.figure, tmp_path / "front.png", tmp_path / "front.svg")
