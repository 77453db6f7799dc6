"""Edge lists are read and written, with the options of all mission files."""

import math

import pytest

from botohe_moo import MissionError, load_mission, save_mission

TEXT = "from,to,p_loss,reward\ndock,reef,0.25,5\nreef,dock,0.5,\n"


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "site.csv"
    path.write_text(TEXT)
    return path


def test_an_edge_list(path):
    mission = load_mission(path, base="dock", robots=2)
    assert mission.rewards.tolist() == [0, 5]
    assert mission.graph.edges["dock", "reef"]["survival"] == 0.75


def test_its_own_option_and_those_of_all_formats(path):
    path.write_text(TEXT.replace("0.5", "").replace("0.25", "25"))
    given = {"base": "dock", "robots": 2, "per_cent": True, "danger": 1}
    mission = load_mission(path, **given)
    assert mission.graph.edges["dock", "reef"]["survival"] == 0.75
    back = mission.graph.edges["reef", "dock"]["survival"]
    assert back == math.exp(-1)


def test_what_is_written_is_read(path):
    mission = load_mission(path, base="dock", robots=2)
    save_mission(mission, path)
    assert load_mission(path, base="dock", robots=2) == mission


def test_another_table(path):
    path.write_text("label,reward\ndock,0\n")
    with pytest.raises(MissionError, match="expected a first line from,to"):
        load_mission(path, base="dock", robots=2)


def test_what_is_wrong_is_named(path):
    path.write_text(TEXT.replace("0.5", "half"))
    with pytest.raises(MissionError, match="line 3: expected p_loss, got"):
        load_mission(path, base="dock", robots=2)
