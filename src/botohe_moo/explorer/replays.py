"""The replay: a mission that was played, as one page."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from botohe_moo.base.files import replace_file
from botohe_moo.base.numbers import price_text
from botohe_moo.explorer.data import site_data
from botohe_moo.explorer.page import check_page_file, render
from botohe_moo.explorer.texts import LITTLE, number_texts, probability_codes, sentence_writer
from botohe_moo.mission.model import Mission
from botohe_moo.underway import POLICIES, PlayedMission, PlayedStep

SCRIPTS = ("data", "room", "map", "site", "replay")


def replay(played: PlayedMission, path: str | os.PathLike[str]) -> Path:
    """Write a page on which robots move along their trails, are lost, and get new trails.

    One HTML file that needs no network.

    Parameters
    ----------
    played
        A mission that was played.
    path
        File to write or to replace; ends in ``.html``.

    Returns
    -------
    pathlib.Path
        The file.

    Raises
    ------
    ValueError
        If the ``pos`` of a node is not two finite numbers, or the path ends otherwise.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.underway import play_mission
    >>> from botohe_moo.explorer import replay
    >>> toy = load_mission("toy")
    >>> played = play_mission(toy, toy.plan([[1, 2, 4, 2, 1], [1, 3, 1]]), price=2)
    >>> replay(played, "replay.html").name
    'replay.html'
    """
    path = check_page_file(path)
    replace_file(path, replay_page(played).encode())
    return path


def replay_page(played: PlayedMission) -> str:
    """Return the page that :func:`replay` writes, as text.

    Parameters
    ----------
    played
        As for :func:`replay`, which also says what is raised.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.underway import play_mission
    >>> from botohe_moo.explorer import replay_page
    >>> toy = load_mission("toy")
    >>> replay_page(play_mission(toy, toy.stay_home(), price=2))[:15]
    '<!DOCTYPE html>'
    """
    return render(played.mission.title, replay_data(played), "replay.html.j2", SCRIPTS)


def replay_data(played: PlayedMission) -> dict[str, Any]:
    """Compute the data of the page; its plans are those of the steps."""
    mission, steps = played.mission, played.steps
    write = sentence_writer(mission.nodes)
    number = {trail: i for i, trail in enumerate(dict.fromkeys(t for s in steps for t in s.trails))}
    plans = [[number[trail] for trail in step.trails] for step in steps]
    price = price_text(played.price)
    return {
        "about": write(
            f"Mission {played.number} of seed {played.seed}: {POLICIES[played.policy]}; {price}"
        ),
        "robots": mission.robots,
        **site_data(mission),
        "trails": [[mission.index(node) for node in trail] for trail in number],
        "plans": plans,
        "at": [step.at for step in steps],
        "lost": [step.lost for step in steps],
        "reached": [_codes(mission, step) for step in steps],
        "banked": number_texts(step.reward for step in steps),
        "said": [write(text) for text in played.sentences],
        "told": [
            i
            for i in range(1, len(steps))
            if plans[i] != plans[i - 1] or steps[i].lost != steps[i - 1].lost
        ],
    }


def _codes(mission: Mission, step: PlayedStep) -> list[int]:
    """Return codes of the nodes on the trails, by their indices: 0 for those not visited yet.

    Those of the others are shares of their rewards that count, or `LITTLE` where none does.
    """
    ways = zip(step.trails, step.at, strict=True)
    visited = {node for trail, at in ways for node in trail[: at + 1]}
    nodes = sorted({node for trail in step.trails for node in trail}, key=mission.index)
    rewards = (mission.rewards[mission.index(node)] or 1.0 for node in nodes)
    shares = [
        step.collected.get(node, 0.0) / pays for node, pays in zip(nodes, rewards, strict=True)
    ]
    codes = zip(nodes, probability_codes(shares), strict=True)
    return [(code or LITTLE) if node in visited else 0 for node, code in codes]
