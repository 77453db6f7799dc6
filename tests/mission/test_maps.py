"""Maps as files: YAML that names an image, what route graphs take from them, and roadmaps."""

import json
import math
import sys
import warnings

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image
from scipy.ndimage import distance_transform_edt

from botohe_moo import Mission, MissionError, load_mission, roadmap_from_map, save_mission
from botohe_moo.mission.formats.maps import FREE, MODES, OCCUPIED, UNKNOWN, read_raster
from tests.examples import examples
from tests.test_damaged_files import changed, read_or_refused

HAZARD = {"image": "map.png", "mode": "scale", "resolution": 0.5, "origin": [-1, 2, 0], "negate": 0}
WHITE, GREY, CLEAR = 254, 205, [0, 0, 0, 0]  # grey 205: unknown, by those who save maps


@pytest.fixture
def drawn(tmp_path):
    """Writes a map of pixels, the first row at the top, or of an image; returns its path."""

    def write(pixels, *, kind=np.uint8, save=(), usual=HAZARD, **keys):
        content = {**usual, **keys}
        is_image = isinstance(pixels, Image.Image)
        image = pixels if is_image else Image.fromarray(np.array(pixels, kind))
        image.save(tmp_path / content["image"], **dict(save))
        path = tmp_path / "map.yaml"
        # A key a line, so that faults are named by their lines.
        path.write_text("".join(f"{key}: {json.dumps(value)}\n" for key, value in content.items()))
        return path

    return write


def test_the_first_row_is_at_the_top(drawn):
    for image in ("map.png", "map.pgm"):
        raster = read_raster(drawn([[0, 255, 51], [0, 0, 255]], image=image))
        assert raster.values.tolist() == [pytest.approx([1.0, 0.0, 0.8]), [1.0, 1.0, 0.0]]
        assert (raster.resolution, raster.origin) == (0.5, (-1.0, 2.0))


def palette(*greys):
    image = Image.new("P", (len(greys), 1))
    image.putpalette([grey for grey in greys for _ in range(3)])
    image.putdata(range(len(greys)))
    return image


SHARES = [
    ([[0, 65_535]], {"kind": np.uint16}, [1, 0]),
    ([[[255, 255, 255], [0, 0, 0], [255, 0, 0]]], {}, [0, 1, 2 / 3]),
    (palette(255, 0), {}, [0, 1]),
    *(([[0, 255, 51]], {"negate": yes}, [0, 1, 0.2]) for yes in (1, True, "yes")),
    ([[0, 255]], {"origin": [-1, 2, 0.0], "frame_id": "map", "voxels": {"a": 1}}, [1, 0]),
    # The plain scale, as in the tutorial of Nav2's speed filter.
    ([[0, 255, 51]], {"free_thresh": 0.0, "occupied_thresh": 1.0}, [1, 0, 0.8]),
    # Shares 1, 0.8, 0.6, 0.4 and 0.2, on a scale from 0.2 to 0.6.
    ([[0, 51, 102, 153, 204]], {"free_thresh": 0.2, "occupied_thresh": 0.6}, [1, 1, 1, 0.5, 0]),
    ([[51, 204]], {"occupied_thresh": 0.4}, [1, 0.5]),
    ([[0, 127, 128, 255]], {"free_thresh": 0.5, "occupied_thresh": 0.5}, [1, 1, 0, 0]),
]


@pytest.mark.filterwarnings("error")
def test_shares_are_those_of_the_map_server(drawn):
    for pixels, options, expected in SHARES:
        assert read_raster(drawn(pixels, **options)).values.tolist() == [pytest.approx(expected)]


def test_cells_are_those_of_the_map_server(drawn):
    """Shares 1, 0.8, 0.6, 0.4, 0.2 and 0, and the grey of map savers."""
    pixels, names = [[0, 51, 102, 153, 204, 255, GREY]], {FREE: ".", OCCUPIED: "X", UNKNOWN: "?"}
    for keys, expected in (
        ({}, "XX??..?"),
        ({"occupied_thresh": 0.9}, "X???..?"),
        ({"free_thresh": 0.5}, "XX?...?"),
        ({"free_thresh": 0}, "XX?????"),
        ({"negate": 1}, "..??XXX"),
    ):
        for mode in ("Trinary", "scale"):
            [cells] = read_raster(drawn(pixels, mode=mode, **keys), modes=MODES).cells
            assert "".join(map(names.get, cells)) == expected


@pytest.mark.parametrize(
    ("pixels", "save", "n_clear"),
    [
        ([[CLEAR, [255, 255, 255, 0], [0, 0, 0, 254], [0, 0, 0, 255]]], {}, 3),  # RGBA
        (np.array([[[0, 0], [255, 0], [0, 128], [0, 255]]]), {}, 3),  # LA
        (palette(0, 255, 0, 0), {"transparency": bytes([0, 0, 99, 255])}, 3),
        (palette(51, 51, 51, 0), {"transparency": 1}, 1),
        (Image.fromarray(np.array([[51, 51, 51, 0]], np.uint8)), {"transparency": 51}, 3),
        (Image.fromarray(np.array([[7, 7, 7, 0]], np.uint16)), {"transparency": 7}, 3),
    ],
)
def test_what_is_transparent_is_unknown(drawn, pixels, save, n_clear):
    """The last pixel is black; those before it are clear, or partly so, in any colour."""
    with pytest.warns(UserWarning, match=rf"map\.yaml: {n_clear} of 4 pixels are transparent: unk"):
        raster = read_raster(drawn(pixels, save=save))
    is_clear = raster.values[0] == 0
    assert is_clear.sum() == n_clear
    assert raster.values[0, 3] == 1
    assert (raster.cells[0][is_clear] == UNKNOWN).all()
    with warnings.catch_warnings():  # a map of obstacles has unknown cells
        warnings.simplefilter("error")
        for mode in MODES:
            found = read_raster(drawn(pixels, save=save, mode=mode, negate=1), modes=MODES)
            assert (found.cells[0] == UNKNOWN).sum() == n_clear
            assert (found.values[0][is_clear] == 0).all()


def test_the_image_lies_beside_the_file_or_at_home(drawn, tmp_path, monkeypatch):
    home = tmp_path / "home"
    home.mkdir()
    for folder in ("HOME", "USERPROFILE"):
        monkeypatch.setenv(folder, str(home))
    path = drawn([[0]])
    (tmp_path / "map.png").rename(home / "map.png")
    text = path.read_text()
    for image in ("~/map.png", "home/map.png", "./home/../home/map.png", str(home / "map.png")):
        path.write_text(text.replace("map.png", image))
        assert read_raster(path).values == [[1]]


WRONG = [
    ({"mode": "trinary"}, "line 2: expected mode to be scale, got 'trinary'"),
    ({"free_thresh": 2}, r"line 6: expected free_thresh <= 1, got 2"),
    ({"occupied_thresh": 0.3, "free_thresh": 0.4}, r"line 7: .* <= occupied_thresh, 0\.3, got"),
    ({"resolution": -1}, "line 3: expected resolution > 0, got -1"),
    ({"origin": [-1, 2, 0.5]}, r"line 4: expected origin \[x, y, 0\], without rotation, got"),
    ({"image": None}, "line 1: expected the key 'image', which is missing"),
    ({"image": "no.png"}, r"image 'no\.png': no such file"),
    ({"image": "~nobody-here/no.png"}, "image '~nobody-here/no.png': "),
    ({"image": "map.yaml"}, r"image 'map\.yaml': expected an image, such as PNG or PGM"),
    ({"image": "map.tif"}, r"image 'map\.tif': expected integers as pixels, found floats"),
    ({"image": "cut.png"}, r"image 'cut\.png': cannot be read: "),
]


def test_wrong_values_are_named_by_their_lines(drawn, tmp_path):
    drawn([[0.5]], kind=np.float32, image="map.tif")
    path = drawn(np.zeros((99, 99)))
    (tmp_path / "cut.png").write_bytes((tmp_path / "map.png").read_bytes()[:60])
    for keys, fault in WRONG:
        left = {key: value for key, value in {**HAZARD, **keys}.items() if value is not None}
        path.write_text("".join(f"{key}: {value}\n" for key, value in left.items()))
        with pytest.raises(MissionError, match=rf"map\.yaml: {fault}"):
            read_raster(path)


def test_files_that_are_no_maps(tmp_path):
    path = tmp_path / "map.yaml"
    for text, fault in (
        ("[1, 2]", r"expected the file to be a mapping, got \[1, 2\]"),
        ("a: [", "not valid YAML"),
        ("{image: a, resolution: 1, origin: [0, 0], mode: raw}", "mode to be trinary or scale"),
    ):
        path.write_text(text)
        with pytest.raises(MissionError, match=rf"map\.yaml: .*{fault}"):
            read_raster(path, modes=MODES)


@pytest.mark.fuzz
@pytest.mark.filterwarnings("ignore:.* pixels are transparent")
@pytest.mark.parametrize(
    ("name", "content"),
    [("map.yaml", json.dumps(HAZARD).encode()), ("map.png", b"P2\n3 2\n255\n0 10 255\n9 8 7\n")],
)
@examples(100)
@given(data=st.data())
def test_changed_files(tmp_path_factory, name, content, data):
    folder = tmp_path_factory.getbasetemp() / "maps"
    folder.mkdir(exist_ok=True)
    Image.fromarray(np.array([[7]], np.uint8)).save(folder / "map.png")
    (folder / "map.yaml").write_text(json.dumps(HAZARD))
    (folder / name).write_bytes(data.draw(changed(content)))
    raster = read_or_refused(read_raster, folder / "map.yaml", named=folder, errors=MissionError)
    if raster is not None:
        assert 0 < raster.resolution < math.inf
        assert ((raster.values >= 0) & (raster.values <= 1)).all()


ORIGIN = (-2.0, 3.0)
SITE = {"image": "map.png", "resolution": 0.1, "origin": [*ORIGIN, 0]}


def hall(height, width, *rooms):
    """Free rectangles (first row, last row, first column, last column) among obstacles."""
    cells = np.zeros((height, width), np.uint8)
    for top, bottom, left, right in rooms:
        cells[top : bottom + 1, left : right + 1] = WHITE
    return cells


CORRIDOR = hall(9, 60, (2, 6, 2, 57))
LOOP = hall(60, 100, (5, 54, 5, 74))
LOOP[15:45, 15:65] = 0


def lengths(graph):
    """Each way once."""
    return sorted(length for one, other, length in graph.edges(data="length") if one < other)


# Skeletons are compiled at their first use; in `make test` the guide makes a roadmap.
@pytest.mark.slow
class TestRoadmaps:
    """Of small maps that are drawn here: how many nodes, and how long the ways are."""

    @pytest.fixture
    def drawn(self, drawn):
        return lambda cells, **keys: drawn(cells, usual=SITE, **keys)

    def test_a_corridor(self, drawn):
        """Five cells wide: those in the middle, from column 4 to 55, are 0.25 m from obstacles."""
        graph = roadmap_from_map(drawn(CORRIDOR), radius=0.25)
        ends = [[pytest.approx(-2 + x * 0.1), pytest.approx(3 + 4.5 * 0.1)] for x in (4.5, 55.5)]
        assert list(graph.nodes(data=True)) == [
            (0, {"pos": ends[0], "reward": 0.0}),
            (1, {"pos": ends[1], "reward": 1.0}),
        ]
        way = {"length": pytest.approx(5.1)}
        assert list(graph.edges(data=True)) == [(0, 1, way), (1, 0, way)]
        assert graph.graph == {"base": 0}

    def test_dangers_on_a_map(self, drawn, tmp_path):
        """Black from column 30 on: half the rate at its left edge, all of it half a cell on."""
        path = drawn(CORRIDOR)
        even = roadmap_from_map(path, radius=0.25, danger=0.2)
        assert even.edges[0, 1]["survival"] == pytest.approx(math.exp(-0.2 * 5.1))
        hazard = tmp_path / "hazard.yaml"
        text = path.read_text().replace("map.png", "hazard.png") + "mode: scale\n"
        hazard.write_text(text)
        cells = np.full((9, 60), 255, np.uint8)
        for black, length in ((cells * 0, 5.1), (cells * (np.arange(60) < 30), 2.5 + 0.05)):
            Image.fromarray(black.astype(np.uint8)).save(tmp_path / "hazard.png")
            graph = roadmap_from_map(path, radius=0.25, danger=0.2, hazard=hazard)
            for arc in ((0, 1), (1, 0)):
                assert graph.edges[arc]["survival"] == pytest.approx(math.exp(-0.2 * length))
        hazard.write_text(text.replace("[-2.0", "[-1.0"))
        said = r"hazard\.yaml: expected a map that covers \[-1\.\d\d?, 3.*\], but it goes from"
        with pytest.raises(MissionError, match=said):
            roadmap_from_map(path, radius=0.25, danger=0.2, hazard=hazard)

    @pytest.mark.parametrize(
        ("cells", "degrees", "total"),
        [
            # A corridor on row 30 from column 4 to 105, others up at column 22 and down at 72.
            (hall(60, 110, (28, 32, 2, 107), (2, 32, 20, 24), (28, 57, 70, 74)), "111133", 15.2),
            # Ways without ends and crossings get three nodes; between the middles of the sides.
            (LOOP, "222", 2 * (6 + 4)),
            # Of ways beside each other, one gets a node: the end, the crossing, and the loop's two.
            (LOOP | hall(60, 100, (27, 33, 75, 97)), "1223", 22.1),
            # A way across, so that three ways join two crossings.
            (LOOP | hall(60, 100, (27, 33, 75, 97), (15, 44, 35, 44)), "12333", 26),
            # A dead end that is shorter than a robot's radius disappears.
            (hall(50, 120, (30, 38, 2, 117), (29, 30, 55, 63)), "11", 11),
            (hall(50, 120, (30, 38, 2, 117), (10, 30, 55, 63)), "1113", 12.9),
        ],
    )
    def test_crossings_ends_and_loops(self, drawn, cells, degrees, total):
        graph = roadmap_from_map(drawn(cells), radius=0.25)
        assert "".join(map(str, sorted(d for _, d in graph.out_degree()))) == degrees
        assert sum(lengths(graph)) == pytest.approx(total, rel=0.04)
        if degrees == "222":
            assert len(set(lengths(graph))) == 1  # equally far apart

    def test_spacing(self, drawn):
        graph = roadmap_from_map(drawn(CORRIDOR), radius=0.25, spacing=1.0, danger=0.02)
        assert lengths(graph) == [pytest.approx(0.85)] * 6
        for _, _, survival in graph.edges(data="survival"):
            assert survival == pytest.approx(math.exp(-0.02 * 0.85))

    def test_the_base(self, drawn):
        given = {"path": drawn(CORRIDOR), "radius": 0.25, "spacing": 1.0}
        assert roadmap_from_map(base=4, **given).graph["base"] == 4
        at = roadmap_from_map(base=(0.4, 9), **given)
        assert at.graph["base"] == 2
        assert at.nodes(data="reward")[2] == 0
        for wrong in (7, -1, "a", (1,), (math.nan, 0), None):
            with pytest.raises(ValueError, match="Expected base to be a node, 0 to 6, or a place"):
                roadmap_from_map(base=wrong, **given)

    def test_unknown_cells_are_not_free(self, drawn):
        """Also with the threshold that map savers write, by which their grey would be free."""
        expected = roadmap_from_map(drawn(CORRIDOR), radius=0.25)
        grey = np.where(CORRIDOR == 0, GREY, WHITE)
        # Under a clear pixel, white is not free either.
        clear = np.stack([np.full((9, 60), 255)] * 3 + [np.where(CORRIDOR == 0, 0, 255)], axis=2)
        for cells, threshold, mode in ((grey, 0.25, "trinary"), (clear, 0.196, "Scale")):
            path = drawn(cells, free_thresh=threshold, mode=mode)
            assert nx.utils.graphs_equal(roadmap_from_map(path, radius=0.25), expected)

    def test_what_does_not_join_the_largest_part_is_left_out(self, drawn):
        cells = hall(30, 60, (2, 6, 2, 57), (15, 19, 2, 30))
        said = "Left out parts of the map that do not join the largest one: 1, with 3"
        with pytest.warns(UserWarning, match=rf"{said}\d\.\d% of where a robot") as warned:
            graph = roadmap_from_map(drawn(cells), radius=0.25)
        assert warned[0].filename == __file__
        y = pytest.approx(3 + 25.5 * 0.1)
        assert [place[1] for _, place in graph.nodes(data="pos")] == [y, y]

    NO_WAY = r"expected ways through free space for a robot of radius 0\.3, found none: "
    CLOSE, HALL = NO_WAY + r"the largest clearance is 0\.05$", NO_WAY + ".* a round or square hall"

    @pytest.mark.parametrize(
        ("cells", "keys", "fault"),
        [
            ([[0] + [GREY] * 98 + [128]], {}, "no cell is free; 99% are unknown, 1% are occupied"),
            (np.full((50, 50, 4), CLEAR), {}, "no cell is free; 100% are unknown"),
            (CORRIDOR, {"free_thresh": 0}, "no cell is free; 52% are unknown, 48% are occupied"),
            (hall(9, 9, (4, 4, 4, 4)), {}, CLOSE),
            ([[WHITE]], {}, CLOSE),
            (CORRIDOR, {}, NO_WAY + r"the largest clearance is 0\.25$"),
            (hall(9, 9, (1, 7, 1, 7)), {}, HALL),
        ],
    )
    def test_why_there_is_no_way(self, drawn, cells, keys, fault):
        with pytest.raises(MissionError, match=rf"map\.yaml: {fault}"):
            roadmap_from_map(drawn(cells, **keys))

    def test_options_are_checked(self, drawn, monkeypatch):
        for own, fault in (
            ({"radius": 0}, "Expected radius > 0, got 0"),
            ({"spacing": 1e-9}, r"Expected spacing >= 0\.1, the width of a cell, got 1e"),
            ({"danger": -1}, "Expected danger >= 0, got -1"),
            ({"hazard": "none.yaml"}, "Expected danger, the rate of loss where the map is black"),
            # Of 51 cells in a row.
            ({"radius": 0.25, "danger": 200}, r"Arc from \[-1.55, 3.45\] to .* 200 \* 5\.1 = "),
        ):
            with pytest.raises(ValueError, match=fault):
                roadmap_from_map(drawn(CORRIDOR), **own)
        for package in ("skan", "skimage.morphology"):
            monkeypatch.setitem(sys.modules, package, None)
            with pytest.raises(MissionError, match=r"skan: pip install 'botohe-moo\[maps"):
                roadmap_from_map(drawn(CORRIDOR))

    @examples(100)
    @given(
        coarse=arrays(bool, st.tuples(st.integers(1, 9), st.integers(1, 9))),
        size=st.integers(1, 9),
        radius=st.sampled_from([0.01, 0.1, 0.25, 0.5]),
        spacing=st.sampled_from([None, 0.7]),
    )
    @pytest.mark.filterwarnings("ignore:Left out parts")
    def test_any_map_is_a_mission_or_refused(self, tmp_path_factory, coarse, size, radius, spacing):
        folder = tmp_path_factory.getbasetemp() / "roadmaps"
        folder.mkdir(exist_ok=True)
        cells = np.kron(coarse, np.ones((size, size), int)) * WHITE
        Image.fromarray(cells.astype(np.uint8)).save(folder / "map.png")
        (folder / "map.yaml").write_text(json.dumps(SITE))
        given = {"path": folder / "map.yaml", "radius": radius, "spacing": spacing, "danger": 0.1}
        room = distance_transform_edt(np.pad(cells > 0, 1))[1:-1, 1:-1]
        fits = (room.max() - 0.5) * 0.1 >= radius * (1 - 1e-9)
        try:
            graph = roadmap_from_map(**given)
        except MissionError as error:
            why = "a round or square hall" if fits else "the largest clearance is"
            assert (why if coarse.any() else "no cell is free") in str(error)  # noqa: PT017
            return
        assert fits
        mission = Mission(graph, robots=2)  # all of whose nodes the base reaches
        save_mission(mission, folder / "site.json")
        assert load_mission(folder / "site.json") == mission
        for _, (x, y) in graph.nodes(data="pos"):
            row = len(cells) - 1 - math.floor((y - ORIGIN[1]) / 0.1 + 1e-6)
            column = math.floor((x - ORIGIN[0]) / 0.1 + 1e-6)
            if radius > 0.05:  # with less, ways pass between corners
                # Nodes between others lie on a line through cells, which may cut a corner.
                least = radius if spacing is None else radius - 0.15
                assert (room[row, column] - 0.5) * 0.1 >= least * (1 - 1e-6)
        for one, other, length in graph.edges(data="length"):
            apart = math.dist(graph.nodes[one]["pos"], graph.nodes[other]["pos"])
            assert length >= apart - 1e-5
            assert graph.edges[other, one]["length"] == length
            assert spacing is None or length <= spacing + 1e-5
        assert nx.utils.graphs_equal(graph, roadmap_from_map(**given))
