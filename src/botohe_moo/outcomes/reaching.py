"""Which robot reaches which node of a plan, and collects its reward."""

from __future__ import annotations

import numpy as np

from botohe_moo.base.types import FloatArray
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.outcomes.joining import Followed, follow
from botohe_moo.trails import TrailPlan


def reach_probabilities(mission: Mission, plan: TrailPlan) -> FloatArray:
    """Compute with what probability each robot reaches each node.

    Parameters
    ----------
    mission, plan
        A mission, and a plan that is valid for it; otherwise a PlanError is raised.

    Returns
    -------
    numpy.ndarray
        Shape (robots, n_nodes), robots in the order of the plan, nodes in that of
        ``mission.nodes``; 1 where its trail begins, 0 at nodes that are not on it.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.outcomes import reach_probabilities
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1]])
    >>> toy.nodes
    (1, 2, 3, 4, 5)
    >>> reach_probabilities(toy, plan).round(3).tolist()
    [[1.0, 0.81, 0.0, 0.81, 0.0], [1.0, 0.0, 0.0, 0.0, 0.0]]
    """
    check_mission(mission).evaluate([plan])
    followed = follow(mission, plan)
    return _by_node(mission, followed, followed.alive)


def collect_probabilities(mission: Mission, plan: TrailPlan) -> FloatArray:
    """Compute with what probability each robot collects the reward of each node.

    It has to get there, to collect it, of which the chance is the node's ``share``, and, if the
    node pays on return, to bring it to a depot. The team's E[R] follows from them as from
    :func:`team_reach`. Where all robots are alike, and all nodes pay on arrival, these are the
    probabilities to reach the nodes.

    Parameters
    ----------
    mission, plan
        As for :func:`reach_probabilities`.

    Returns
    -------
    numpy.ndarray
        Shape (robots, n_nodes), as for :func:`reach_probabilities`.

    Examples
    --------
    >>> from botohe_moo import Mission, load_mission
    >>> from botohe_moo.outcomes import collect_probabilities
    >>> toy = load_mission("toy")
    >>> mission = Mission(toy.graph, pays="return")
    >>> plan = mission.plan([[1, 2, 4, 2, 1], [1]])
    >>> collect_probabilities(mission, plan).round(3).tolist()
    [[1.0, 0.656, 0.0, 0.656, 0.0], [1.0, 0.0, 0.0, 0.0, 0.0]]
    """
    check_mission(mission).evaluate([plan])
    return collected(mission, plan)


def collected(mission: Mission, plan: TrailPlan) -> FloatArray:
    """Compute :func:`collect_probabilities` of valid trails, of any number of robots."""
    followed = follow(mission, plan)
    return _by_node(mission, followed, followed.share * followed.credited)


def _by_node(mission: Mission, followed: Followed, chances: FloatArray) -> FloatArray:
    """Return the largest chance of all visits, robot by robot and node by node."""
    found = np.zeros((len(followed.offsets) - 1, len(mission.nodes)))
    robots = np.repeat(np.arange(len(found)), np.diff(followed.offsets))
    # The first visit of a node is its most probable one.
    np.maximum.at(found, (robots, followed.nodes), chances)
    return found


def team_reach(reached: FloatArray) -> FloatArray:
    """Compute with what probability some robot reaches each node, from :func:`reach_probabilities`.

    Robots are lost independently, so it is 1 − Π_k (1 − p[k, v]) for node v.

    Parameters
    ----------
    reached
        Probabilities p, of shape (robots, n_nodes).

    Returns
    -------
    numpy.ndarray
        Shape (n_nodes,).

    Examples
    --------
    >>> import numpy as np
    >>> from botohe_moo.outcomes import team_reach
    >>> team_reach(np.array([[1.0, 0.5], [1.0, 0.5]])).tolist()
    [1.0, 0.75]
    """
    some: FloatArray = 1 - np.prod(1 - reached, axis=0)
    return some
