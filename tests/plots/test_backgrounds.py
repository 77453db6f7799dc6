"""A map behind the graph: where it lies, what it shows, and when there is none."""

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from PIL import Image

from botohe_moo import Mission, load_mission
from botohe_moo.mission.rules import MissionError
from botohe_moo.plots import plot_mission, plot_plan
from botohe_moo.plots.site import read_background

TOY = load_mission("toy")


@pytest.fixture(autouse=True)
def _close_figures():
    mpl.use("Agg")
    yield
    plt.close("all")


def write_map(folder, pixels, more="", *, resolution=0.5):
    """Write a map as ROS's map server has it; pixels are from 0, black, to 255."""
    Image.fromarray(np.asarray(pixels, np.uint8)).save(folder / "map.png")
    path = folder / "map.yaml"
    path.write_text(f"image: map.png\nresolution: {resolution}\norigin: [-1, -2, 0]\n{more}")
    return path


def test_it_lies_at_its_origin_and_black_is_1(tmp_path):
    found = read_background(write_map(tmp_path, [[0, 255, 255], [255, 255, 0]]), TOY)
    assert found.shares.tolist() == [[1, 0, 0], [0, 0, 1]]
    assert found.extent == (-1, 0.5, -2, -1)


@pytest.mark.parametrize("more", ["", "mode: Scale\nfree_thresh: 0.0\noccupied_thresh: 1.0\n"])
def test_nothing_is_drawn_where_the_map_is_transparent(tmp_path, recwarn, more):
    white, black, clear, half = [255] * 4, [0, 0, 0, 255], [0, 0, 0, 0], [0, 0, 0, 128]
    found = read_background(write_map(tmp_path, [[white, black, clear, half]], more), TOY)
    assert found.shares.tolist() == [[0, 1, 0, 0]]
    assert not recwarn.list


def test_all_maps_of_a_plan_have_it_and_show_no_more_than_without(tmp_path):
    path = write_map(tmp_path, np.zeros((40, 40)))
    plan = TOY.plan([[1, 2, 4, 2, 1], [1, 2, 1]])
    pictures = {
        1: lambda **options: plot_mission(TOY, **options),
        3: lambda **options: plot_plan(TOY, plan, **options),
    }
    for n_maps, draw in pictures.items():
        bare, ax = draw(), draw(background=path)
        assert (ax.get_xlim(), ax.get_ylim()) == (bare.get_xlim(), bare.get_ylim())
        maps = [one for one in ax.figure.axes if one.get_legend() or one is ax]
        assert len(maps) == n_maps
        for one in maps:
            (image,) = one.images
            assert tuple(image.get_extent()) == (-1, 19, -2, 18)
            assert image.zorder < min(drawn.zorder for drawn in one.collections)
    assert not bare.images


def test_it_needs_positions_and_a_map(tmp_path):
    graph = TOY.graph.copy()
    del graph.nodes[2]["pos"]
    bare = Mission(graph)
    path = write_map(tmp_path, [[0]])
    said = (
        r"positions for the background .*map.yaml, but the places .*: 1 of 5 nodes have no position"
    )
    with pytest.raises(ValueError, match=said):
        plot_mission(bare, background=path)
    with pytest.raises(ValueError, match=said):
        plot_plan(bare, bare.stay_home(), background=path)
    with pytest.raises(MissionError, match=r"none.yaml: no such file"):
        plot_mission(TOY, background=tmp_path / "none.yaml")
