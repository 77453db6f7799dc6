"""The data of the pages: everything that they show, computed and rounded."""

from __future__ import annotations

import base64
import io
import math
import os
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from itertools import combinations, pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike
from PIL import Image

from botohe_moo import decide
from botohe_moo import outcomes as o
from botohe_moo.base.messages import counted, quoted
from botohe_moo.base.types import FloatArray, OffsetArray
from botohe_moo.decide import Choice
from botohe_moo.decide.choosing import best
from botohe_moo.decide.wishes import N_SAMPLES, Candidates, Wish
from botohe_moo.mission.model import Mission
from botohe_moo.plots import site as maps
from botohe_moo.plots.site import Background, Site, only_some
from botohe_moo.trails import TrailPlan

if TYPE_CHECKING:
    from botohe_moo.solution import Solution

DIGITS = 3  # of the largest number of a kind; the same number of decimals for probabilities
_MAX_BINS = 12  # and one beyond the largest reward
# Not in a wish, which says what someone asked for.
_NUMBER = re.compile(r'"(?:[^"\\]|\\.)*"|(?<![\w.])(?<!= )(?P<number>\d+\.\d+(?:e[+-]\d+)?)(?!\w)')
LITTLE, NEARLY = 1001, 1002  # codes of probabilities that would round to 0 and to 1


def sentence(text: str) -> str:
    """Write a sentence as the page shows it: its numbers have three digits, except in wishes."""
    return _NUMBER.sub(_shortened, text)


def _shortened(found: re.Match[str]) -> str:
    """Write a number with three digits; labels in quotes stay as they are."""
    if found["number"] is None:
        return found[0]
    value = float(found["number"])
    return f"{value:.{DIGITS}g}" if value < 10**DIGITS - 0.5 else f"{value:.0f}"


def number_texts(values: Iterable[float], digits: int = DIGITS) -> list[str]:
    """Write numbers with as many decimals as show some digits of the largest, if they need them.

    >>> number_texts([1.5, 13.07]), number_texts([1 / 3, 1, 2]), number_texts([2, 3, 1250.4])
    (['1.5', '13.1'], ['0.33', '1.00', '2.00'], ['2', '3', '1250'])
    """
    listed = [float(value) for value in values]
    largest = max(map(abs, listed), default=0.0)
    size = math.floor(math.log10(largest)) if largest > 0 else 0
    texts = [f"{value:.{min(max(digits - 1 - size, 0), 12)}f}" for value in listed]
    ends = [text.partition(".")[2].rstrip("0") for text in texts]
    decimals = max(map(len, ends), default=0)
    return [f"{float(text):.{decimals}f}" for text in texts]


def probability_codes(values: ArrayLike) -> list[int]:
    """Round probabilities to thousandths; 1001 is above 0 but rounds to it, 1002 the same below 1.

    >>> probability_codes([0, 0.0001, 0.0625, 0.5, 0.99999, 1])
    [0, 1001, 62, 500, 1002, 1000]
    """
    return list(map(_probability_code, np.asarray(values, float).tolist()))


def _probability_code(value: float) -> int:
    code = round(round(value, 3) * 1000)  # of the decimal number, as texts are rounded
    if code <= 0 < value:
        return LITTLE
    if code >= 1000 and value < 1 - 1e-12:
        return NEARLY
    return max(code, 0)


def bin_edges(largest: float) -> FloatArray:
    """Cut rewards from 0 to beyond the largest into at most 13 bins of a round width.

    >>> bin_edges(13.07).tolist()
    [0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0]
    """
    ticks = MaxNLocator(_MAX_BINS, steps=[1, 2, 5, 10])
    edges = np.asarray(ticks.tick_values(0.0, largest or 1.0))
    beyond = edges[-1] > largest * (1 + 1e-9)
    return edges if beyond else np.append(edges, edges[-1] + edges[1])


def bin_codes(distribution: o.Distribution, edges: FloatArray) -> list[int]:
    """Return the probabilities that a reward is in each bin, its lower edge included, as codes."""
    beyond = distribution.at_least(edges)
    return probability_codes(np.clip(beyond[:-1] - beyond[1:], 0, 1))


MAX_PLANS = 500
_N_REPRESENTATIVES = 5
_WRITERS = {"json": decide.plan_json, "csv": decide.plan_csv, "geojson": decide.plan_geojson}
_MOST_STOPS = 25_000  # of all plans; of more, CSV and GeoJSON would take longer than all else


def page_data(
    front: Solution,
    wishes: Iterable[str | Wish | Choice] = (),
    *,
    background: str | os.PathLike[str] | None = None,
    max_plans: int = MAX_PLANS,
) -> dict[str, Any]:
    """Compute the data of the page; plans are in order of ascending reward."""
    if not hasattr(front, "plans"):
        raise TypeError(f"Expected a Solution, got {quoted(front)}.")
    mission, n_plans = front.mission, len(front.plans)
    if not n_plans:
        raise ValueError("Expected at least one plan to explore, got none.")
    candidates = Candidates(mission, front.plans)
    wishes = [wishes] if isinstance(wishes, str) else wishes
    choices = [_chosen(candidates, wish) for wish in wishes]
    marks = [(kind, row, *map(sentence, texts)) for kind, row, *texts in _marks(front, choices)]
    expected = front.expected
    order = np.lexsort((-expected[:, 1], expected[:, 0]))
    kept = {row for _, row, *_ in marks}
    kept |= {beside.index for choice in choices for beside in choice.cost}
    kept_places = np.flatnonzero(np.isin(order, list(kept))).tolist()
    rows = order[thinned(expected[order], kept_places, max_plans)].tolist()
    place = {row: i for i, row in enumerate(rows)}
    marked = sorted({place[row] for _, row, *_ in marks})
    plans = [front.plans[row] for row in rows]
    # Differences in words between neighbours and between marked plans: all pairs are too many.
    pairs = sorted({*pairwise(range(len(plans))), *combinations(marked, 2)})
    words = {(i, j): decide.compare(mission, plans[i], plans[j]).sentences for i, j in pairs}
    spent = f"seed {front.seed}, {counted(front.evaluations, 'evaluation')}"
    note = (
        f"The page shows {len(rows):,} of the {n_plans:,} plans: those that dominate the most area "
        "(hypervolume) alone, both ends of the front, all that are marked, and those with which "
        "a chosen plan is compared."
    )
    return {
        "name": mission.name,
        "about": f"{counted(n_plans, 'plan')} by {front.algorithm}, {spent}; area {front.area:.3f}",
        "thinned": note if len(rows) < n_plans else "",
        "robots": mission.robots,
        "total": mission.total_reward,
        **site_data(mission),
        "background": picture_data(maps.read_background(background, mission)),
        **_trails(mission, plans),
        **_plans(candidates, rows),
        "files": _files(mission, dict(zip(rows, plans, strict=True)), set(marked)),
        "ids": rows,
        "marks": [
            {"kind": kind, "plan": place[row], "name": name, "text": text}
            for kind, row, name, *text in marks
        ],
        "words": {f"{i}-{j}": tuple(map(sentence, said)) for (i, j), said in words.items()},
    }


def thinned(objectives: FloatArray, kept: Collection[int], n_plans: int) -> OffsetArray:
    """Choose ``n_plans`` rows of a front that ascends in reward and descends in survivors.

    One after another, the plan goes that dominates the least area alone. Both ends and the rows
    ``kept`` stay, even if these are more than ``n_plans``.
    """
    rows: OffsetArray = np.arange(len(objectives))
    while len(rows) > n_plans:
        reward, survivors = objectives[rows].T
        alone = np.diff(reward[:-1]) * -np.diff(survivors[1:])
        alone[np.isin(rows[1:-1], list(kept))] = np.inf
        if not np.isfinite(alone).any():
            break
        rows = np.delete(rows, 1 + np.argmin(alone))
    return rows


def _files(
    mission: Mission, plans: dict[int, TrailPlan], marked: Collection[int]
) -> dict[str, list[tuple[str, str]]]:
    """Write each plan as the files of its formats: the text, or why there is none.

    ``plans`` are known by their rows, ``marked`` by their places among them.
    """
    is_small = sum(len(plan.nodes) for plan in plans.values()) <= _MOST_STOPS

    def file_of(kind: str, place: int, row: int) -> tuple[str, str]:
        if not (is_small or kind == "json" or place in marked):
            call = f"botohe choose DIR --plan {row} --out plan.{kind}"
            return "", f"Only marked plans have a {kind} file on a page of this size; see {call}."
        try:
            return _WRITERS[kind](mission, plans[row]), ""
        except ValueError as fault:
            return "", str(fault)

    return {kind: [file_of(kind, i, row) for i, row in enumerate(plans)] for kind in _WRITERS}


def _trails(mission: Mission, plans: Sequence[TrailPlan]) -> dict[str, Any]:
    """Return each trail once, with what is known of it, and which ones each plan has."""
    trails = [trail for plan in plans for trail in plan.trails]
    survival = dict(zip(trails, mission.robot_survival(plans).ravel().tolist(), strict=True))
    length = dict(zip(trails, mission.trail_lengths(plans).ravel().tolist(), strict=True))
    number, n = {trail: i for i, trail in enumerate(survival)}, len(mission.nodes)
    rewards: dict[tuple[int, ...], float] = {}  # of each robot alone, where a plan's files have it
    if not mission.is_plain:
        alone = [o.rewards_alone(mission, plan) for plan in plans]
        rewards = dict(zip(trails, np.concatenate(alone).tolist(), strict=True))
    return {
        "trails": [tuple(node % n for node in trail) for trail in survival],
        "trail_length_texts": number_texts(length.values()),
        "trail_reward_texts": number_texts(rewards.values()),
        "trail_codes": probability_codes(list(survival.values())),
        "plans": [[number[trail] for trail in plan.trails] for plan in plans],
    }


def _plans(candidates: Candidates, rows: Sequence[int]) -> dict[str, Any]:
    """Return objectives, distributions and other facts of each plan."""
    mission, objectives = candidates.mission, candidates.objectives[rows]
    rewards = [candidates.distribution("reward", row) for row in rows]
    survivors = [candidates.distribution("survivors", row) for row in rows]
    edges = bin_edges(max(float(found.values[-1]) for found in rewards))
    team = np.arange(mission.robots + 1.0)
    plans = [candidates.plans[row] for row in rows]
    # Of nodes on trails, in the order of their indices.
    visited = [np.unique(p.nodes % len(mission.nodes)) for p in plans]
    reach, collected = (
        [o.team_chances(chances, mission, p)[v] for p, v in zip(plans, visited, strict=True)]
        for chances in (o.reach_probabilities, o.collect_probabilities)
    )
    if mission.is_plain:  # it is what is reached
        collected = []
    # With one digit more than other numbers, since neighbours differ little.
    written = [number_texts(column, DIGITS + 1) for column in objectives.T.tolist()]
    decimals = len(written[0][0].partition(".")[2])
    facts: dict[str, Callable[[o.Distribution], float]] = {
        # Not 0.1 itself: the largest reward that is reached so often.
        "Reward reached in 9 of 10 missions": lambda reward: reward.quantile(0.1 + 1e-9),
        "Median reward": lambda reward: reward.quantile(0.5),
        "Mean of the lowest tenth of rewards": lambda reward: reward.cvar(0.1),
    }
    found = {name: [fact(reward) for reward in rewards] for name, fact in facts.items()}
    for scenario in mission.scenarios:
        values = mission.in_scenario(scenario.name).evaluate(plans).T.tolist()
        for what, column in zip(("reward", "survivors"), values, strict=True):
            found[f"Expected {what} in scenario {scenario.name}"] = column
    return {
        "objectives": objectives.tolist(),
        "objective_texts": written,
        "reached": [probability_codes(values) for values in reach],
        "reached_values": [np.round(values, 6).tolist() for values in reach],
        "collected": [probability_codes(values) for values in collected],
        "survivors": [probability_codes(-np.diff(of.at_least(team), append=0)) for of in survivors],
        "rewards_in": [bin_codes(found, edges) for found in rewards],
        "bins": [f"{low:g} to {high:g}" for low, high in pairwise(edges.tolist())],
        "facts": {name: [f"{of:.{decimals}f}" for of in column] for name, column in found.items()},
        "simulated": [not found.exact for found in rewards],
        "n_samples": f"{N_SAMPLES:,}",
    }


def _chosen(candidates: Candidates, wish: str | Wish | Choice) -> Choice:
    """Choose a plan by a wish; a choice is taken as it is, if it is one of these plans."""
    found = wish if isinstance(wish, Choice) else best(candidates, [wish])
    if candidates.plans[found.index : found.index + 1] != (found.plan,):
        raise ValueError(f"Expected a choice among these plans, got plan {found.index} of others.")
    return found


def _marks(front: Solution, choices: Iterable[Choice]) -> Iterator[tuple[Any, ...]]:
    """Yield the plans that are marked: the kind of mark, row, name, and sentences on why."""
    mission, objectives = front.mission, front.expected
    for found in choices:
        kind, said = ("choice", "meets") if found.met else ("miss", "comes nearest to")
        name = f"{said} {' and '.join(map(str, found.wishes))}" if found.wishes else "chosen"
        yield kind, found.index, name, found.why, *found.costs
    for knee in decide.knees(mission, objectives):
        yield "knee", knee.index, f"knee: {knee.name}", f"Knee: {knee.definition}."
    for row in decide.representatives(mission, front.plans, _N_REPRESENTATIVES):
        yield "representative", row, "representative"
    yield "end", int(np.lexsort(objectives.T[::-1])[-1]), "most reward"
    yield "end", int(np.lexsort(objectives.T)[-1]), "most survivors"


def site_data(mission: Mission) -> dict[str, Any]:
    """Return nodes, their places on the map, and arcs."""
    site = maps.Site(mission)
    return {
        "names": [*map(str, mission.nodes)],
        "base": site.base,
        "rewards": mission.rewards.tolist(),
        "reward_texts": number_texts(mission.rewards.tolist()),
        "places": maps.node_positions(mission).tolist(),
        "placing": "".join(f"{note[0].upper()}{note[1:]}." for note in maps.layout_notes(mission)),
        "arcs": [site.tail.tolist(), site.head.tolist(), probability_codes(site.safest)],
        # For what is drawn along trails; each is exact to what a picture can show.
        "arc_lengths": np.round(site.length, 7).tolist(),
        "scenarios": [(of.name, of.probability) for of in mission.scenarios] or [("", 1.0)],
        "arc_survival": [  # in each scenario, of each kind
            np.round(maps.Site(one).survival, 7).tolist() for _, one in mission.in_scenarios
        ],
        **_kinds(mission, site),
    }


def picture_data(background: Background | None) -> dict[str, Any] | None:
    """Return a map behind the graph as a picture, and where it lies: left, right, bottom, top.

    It is grey, and the more transparent the lighter the map, so that it suits dark pages too.
    """
    if background is None:
        return None
    shade = np.round(127 * background.shares).astype(np.uint8)  # half of black: it is to be faint
    file, grey = io.BytesIO(), np.full_like(shade, 128)
    Image.fromarray(np.stack([grey, shade], axis=2), "LA").save(file, "PNG", optimize=True)
    picture = base64.b64encode(file.getvalue()).decode()
    return {"href": f"data:image/png;base64,{picture}", "extent": background.extent}


def _kinds(mission: Mission, site: Site) -> dict[str, Any]:
    """Return what the page shows of kinds and of rewards on return; empty for a plain mission."""
    names = [kind.name for kind in mission.kinds]
    several = len(names) > 1
    arcs, nodes = only_some(site.survival > 0), only_some(site.collects)
    notes = maps.place_notes(site)
    return {
        "kinds": names if several else [],
        "kind_of": [names.index(kind.name) for kind in mission.kind_of] if several else [],
        "ends": site.ends if site.has_ends else [],
        "depots": site.depots.tolist(),
        "rings": [] if site.all_return else site.returning.tolist(),
        # Sets of kinds, and the arcs and nodes that only they can take and collect.
        "only": [
            [kinds, *(np.flatnonzero(of.get(kinds, [])).tolist() for of in (arcs, nodes))]
            for kinds in {**arcs, **nodes}
        ],
        "arc_codes": [*map(probability_codes, site.survival)] if several else [],
        "node_notes": _node_notes(mission, site),
        "key": "".join(f"{note[0].upper()}{note[1:]}. " for note in notes).strip(),
    }


def _node_notes(mission: Mission, site: Site) -> list[str]:
    """Write when each node pays, and for whom not always; nothing for a plain mission."""
    if mission.is_plain:
        return []
    notes: list[list[str]] = [[] for _ in mission.nodes]
    for node in site.depots:
        notes[node].append("depot")
    for node in site.returning:
        notes[node].append("pays on return")
    names = [kind.name if len(mission.kinds) > 1 else "a robot" for kind in mission.kinds]
    for name, share in zip(names, mission.world.team.share.reshape(len(names), -1), strict=True):
        for node in np.flatnonzero((share < 1) & site.collects.any(axis=0)):
            chance = f"collects it with {share[node]:g}" if share[node] > 0 else "cannot collect it"
            notes[node].append(f"{name} {chance}")
    return [", ".join(of_node) for of_node in notes]
