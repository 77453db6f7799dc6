"""What a Pareto local search may do, and what it keeps beside the front."""

from typing import NamedTuple

from botohe_moo._types import FloatArray, IntArray

# A plan that gains less than this, relative, is taken for one that the front has already: the
# objectives of children are computed in another order of operations than those of the front.
TOLERANCE = 1e-12

NOBODY = -1

# Indices into what the search remembers, beside E[S] of the newest plan and how many were evaluated
# since: best responses found, and given up.
THROUGH_WITH = 2
FAILED = 3


class SearchRule(NamedTuple):
    """How to search; :class:`~botohe_moo.ParetoLocalSearch` documents what users may set.

    Attributes
    ----------
    n_children
        Children of a parent before the next is drawn.
    p_newest
        With what probability the next parent is the plan that has just entered the front.
    n_drawn
        Plans among which a parent is chosen, by the area its neighbours leave it.
    p_reserve, slack
        With what probability a parent comes from the reserve, and how much less reward than the
        front, relative, a plan may have to get there: at least ``slack``, and with every parent
        ``slack`` / (1 − u), u drawn from [0, 1), so that now and then anything does.
    p_keep
        With what probability a parent's children may get to the reserve at all, as long as plans
        enter the front: what goes there costs as much as what enters.
    p_neighbour
        With what probability the other plan of a move is one beside the parent.
    p_end
        With what probability the parent is the plan of most reward.
    p_near, p_step, p_more, p_short, n_short, p_meet, p_detour
        See ``reconnect`` and ``combine``.
    patience, p_response, n_response
        When no plan has entered for ``patience`` evaluations: with what probability the search
        looks for a parent's best response (``respond``) or, where missions are large, goes on for
        ``n_response`` evaluations from a front of that robot's trails, the other robots' being
        fixed.
    n_response_hops
        Hops after which the search for a best response is given up.
    min_survival
        Survival floor of every robot.
    max_size
        Plans that the front keeps at most; 0 sets no limit.
    """

    n_children: int = 16
    p_newest: float = 0.9
    n_drawn: int = 2
    p_reserve: float = 0.1
    slack: float = 0.02
    p_keep: float = 0.25
    p_neighbour: float = 0.5
    p_near: float = 0.8
    p_step: float = 0.3
    p_more: float = 0.6
    p_short: float = 0.6
    n_short: int = 4
    p_meet: float = 0.9
    p_detour: float = 0.3
    p_end: float = 0.1
    patience: int = 2_000
    p_response: float = 0.1
    n_response: int = 500
    n_response_hops: int = 50_000
    min_survival: float = 0.0
    max_size: int = 0


class Reserve(NamedTuple):
    """Plans that the front nearly took in.

    Attributes
    ----------
    plan
        Their trails, by number; ``NOBODY`` first where there is none (n_reserve, n_robots).
    survivors
        Their E[S].
    """

    plan: IntArray
    survivors: FloatArray
