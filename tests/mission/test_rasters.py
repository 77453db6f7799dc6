"""Maps of dangers as files: YAML that names an image, and what route graphs take from them."""

import math
import os

import numpy as np
import pytest
from hypothesis import given
from PIL import Image

from botohe_moo import MissionError, load_mission, save_mission
from botohe_moo.mission.formats.maps import read_raster
from tests.examples import examples
from tests.mission.test_routes import both_ways, line, site  # noqa: F401 - a fixture
from tests.test_damaged_files import changed, check_message

TEXT = "image: {image}\nmode: scale\nresolution: 0.5\norigin: [-1, 2, 0]\nnegate: {negate}\n"


@pytest.fixture
def hazard(tmp_path):
    """Writes a map of pixels; returns its path."""

    def write(pixels, *, image="hazard.png", negate=0, kind=np.uint8, text=TEXT):
        Image.fromarray(np.array(pixels, kind)).save(tmp_path / image)
        path = tmp_path / "hazard.yaml"
        path.write_text(text.format(image=image, negate=negate))
        return path

    return write


@pytest.mark.parametrize("image", ["hazard.png", "hazard.pgm"])
def test_black_is_full_scale_and_the_first_row_is_at_the_top(hazard, image):
    raster = read_raster(hazard([[0, 255, 51]], image=image))
    assert raster.values.tolist() == pytest.approx(np.array([[1.0, 0.0, 0.8]]))
    assert (raster.resolution, raster.origin) == (0.5, (-1.0, 2.0))
    assert read_raster(hazard([[0, 255, 51]], negate=1)).values.tolist() == [[0.0, 1.0, 0.2]]


def test_a_black_map_is_the_danger_also_along_lines_that_are_longer(hazard, site):  # noqa: F811
    path = site(*both_ways((3, 4)), line(4, 7, metadata={"length": 9}), line(7, 3))
    given = {"base": 3, "robots": 1, "danger": 0.03}
    black = hazard(np.zeros((20, 20)), text=TEXT.replace("[-1, 2, 0]", "[-1, -1]"))
    mission = load_mission(path, hazard=black, **given)
    assert mission.graph.edges[4, 7]["survival"] == pytest.approx(math.exp(-0.03 * 9))
    zones = [{"circle": [0, 0, 99], "rate": 0.03}]
    mission = load_mission(path, danger_zones=zones, **{**given, "danger": 0})
    assert mission.graph.edges[4, 7]["survival"] == pytest.approx(math.exp(-0.03 * 9))


def test_images_that_cannot_be_shares(hazard, tmp_path):
    path = hazard([[0.5]], kind=np.float32, image="hazard.tif")
    with pytest.raises(MissionError, match=r"image 'hazard\.tif': expected integers as pixels"):
        read_raster(path)
    path = hazard([[0]])
    (tmp_path / "hazard.png").unlink()
    os.mkfifo(tmp_path / "hazard.png")
    with pytest.raises(MissionError, match="cannot be read: expected a file, found a device or a"):
        read_raster(path)


def test_images_of_sixteen_bits_and_in_colour(hazard):
    assert read_raster(hazard([[0, 65_535]], kind=np.uint16)).values.tolist() == [[1.0, 0.0]]
    white_and_black = [[[255, 255, 255], [0, 0, 0]]]
    assert read_raster(hazard(white_and_black)).values.tolist() == [[0.0, 1.0]]
    red = [[[255, 0, 0]]]
    assert read_raster(hazard(red)).values.tolist() == [[pytest.approx(2 / 3)]]


def test_a_black_map_is_the_danger_alone(hazard, site):  # noqa: F811
    path = site(*both_ways((3, 4), (4, 7)))
    given = {"base": 3, "robots": 1, "danger": 0.03}
    black = hazard(np.zeros((20, 20)), text=TEXT.replace("[-1, 2, 0]", "[-1, -1]"))
    alone, with_map = load_mission(path, **given), load_mission(path, hazard=black, **given)
    for tail, head, arc in with_map.graph.edges(data=True):
        assert arc["survival"] == pytest.approx(alone.graph.edges[tail, head]["survival"])
    white = hazard(np.full((20, 20), 255), text=TEXT.replace("[-1, 2, 0]", "[-1, -1]"))
    assert (load_mission(path, hazard=white, **given).arrays.survival == 1).all()


@pytest.mark.filterwarnings("ignore:All survivals are given")
def test_survivals_in_the_file_stay(hazard, tmp_path):
    save_mission(load_mission("toy"), tmp_path / "toy.geojson")
    path = hazard(np.zeros((20, 20)))
    assert load_mission(tmp_path / "toy.geojson", danger=9, hazard=path) == load_mission("toy")


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (TEXT.replace("scale", "trinary"), "line 2: expected mode to be scale, found 'trinary'"),
        (TEXT.replace("mode: scale\n", ""), "expected mode to be scale, found none"),
        (TEXT + "free_thresh: 2\n", r"line 6: expected free_thresh < 1, got 2"),
        (TEXT.replace("0.5", "-1"), "line 3: expected resolution > 0, got -1"),
        (
            TEXT.replace("2, 0]", "2, 0.5]"),
            r"line 4: origin: expected \[x, y, 0\], without",
        ),
        (TEXT.replace("[-1, 2, 0]", "7"), "line 4: expected origin"),
        (TEXT.replace("{negate}", "2"), "line 5: expected negate to be 0 or 1, got 2"),
        (
            TEXT.replace("{image}", "no.png"),
            r"hazard\.yaml: image 'no\.png': there is no such file",
        ),
        (TEXT.replace("{image}", "hazard.yaml"), r"image 'hazard\.yaml': expected an image"),
        (TEXT.replace("{image}", "[1]"), "line 1: expected image to be a text, got"),
        (
            TEXT.replace("scale", "raw"),
            "line 2: expected mode to be 'trinary' or 'scale'",
        ),
        ("[1, 2]", "expected a map, with an image, got"),
        ("a: [", "not valid YAML"),
        ("\x00", "not valid YAML"),
    ],
)
def test_what_is_wrong_is_named_by_its_line(hazard, text, fault):
    path = hazard([[0]])
    path.write_text(text.replace("{image}", "hazard.png").replace("{negate}", "0"))
    with pytest.raises(MissionError, match=fault):
        read_raster(path)


def test_a_map_that_is_too_small(hazard, site):  # noqa: F811
    path = site(*both_ways((3, 4), (4, 7)))
    with pytest.raises(
        MissionError, match=r"site\.geojson: .*hazard\.yaml: expected a map of all arcs"
    ):
        load_mission(path, base=3, robots=1, danger=1, hazard=hazard([[0]]))
    with pytest.raises(MissionError, match=r"lost\.yaml: there is no such file"):
        load_mission(path, base=3, robots=1, danger=1, hazard="lost.yaml")


@pytest.mark.fuzz
@examples(200)
@given(data=changed(TEXT.format(image="hazard.png", negate=0).encode()))
def test_changed_maps(tmp_path_factory, data):
    folder = tmp_path_factory.getbasetemp() / "maps"
    folder.mkdir(exist_ok=True)
    Image.fromarray(np.array([[7]], np.uint8)).save(folder / "hazard.png")
    (folder / "hazard.yaml").write_bytes(data)
    try:
        raster = read_raster(folder / "hazard.yaml")
    except MissionError as error:
        check_message(error, folder)
    else:
        assert 0 < raster.resolution < math.inf


@pytest.mark.fuzz
@examples(200)
@given(data=changed(b"P2\n3 2\n255\n0 10 255\n9 8 7\n"))
def test_changed_images(tmp_path_factory, data):
    folder = tmp_path_factory.getbasetemp() / "images"
    folder.mkdir(exist_ok=True)
    (folder / "hazard.pgm").write_bytes(data)
    (folder / "hazard.yaml").write_text(TEXT.format(image="hazard.pgm", negate=0))
    try:
        raster = read_raster(folder / "hazard.yaml")
    except MissionError as error:
        check_message(error, folder)
    else:
        assert ((raster.values >= 0) & (raster.values <= 1)).all()


def test_rewards_by_what_is_of_interest(hazard, site):  # noqa: F811
    """Full scale is worth the reward for a unit of area; the base is worth nothing."""
    path = site(*both_ways((3, 4), (4, 7)))
    interest = hazard(np.zeros((20, 20)), text=TEXT.replace("[-1, 2, 0]", "[-1, -1]"))
    given = {"base": 3, "robots": 1, "danger": 0.03, "reward": 2}
    mission = load_mission(path, interest=interest, sight=0.5, **given)
    # Within half a unit of a corner of cells of half a unit lie the centres of four.
    assert mission.rewards.tolist() == [0, 2 * 4 * 0.25, 2 * 4 * 0.25]
    with pytest.raises(MissionError, match="expected interest, a map, and sight"):
        load_mission(path, interest=interest, **given)
