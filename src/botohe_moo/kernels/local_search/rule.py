"""What a Pareto local search may do, and what it keeps beside the front."""

from typing import NamedTuple

from botohe_moo._base.types import FloatArray, IntArray
from botohe_moo.kernels.compile import everywhere

# A plan that gains less than this, relative, is taken for one that the front has already: the
# objectives of children are computed in another order of operations than those of the front.
TOLERANCE = 1e-12

NOBODY = -1

# Indices into what a search remembers from one parent to the next.
NEWEST = 0  # E[S] of the plan that has just entered the front, −1 where none has
IDLE = 1  # plans evaluated since one entered
FOUND = 2  # best responses found,
FAILED = 3  # and given up
ROUGH = 4  # 1 once these have been too long, so that they cut more off
CREDIT = 5  # hops that they may take
N_REMEMBERED = 6


class SearchRule(NamedTuple):
    """How to search; :class:`~botohe_moo.ParetoLocalSearch` documents what users may set.

    Attributes
    ----------
    n_children, n_children_busy
        Children of a parent before the next is drawn; and as long as the search is busy.
    busy
        It is when a plan has entered the front within so many evaluations.
    p_newest
        With what probability the next parent is the plan that has just entered the front.
    n_drawn, n_drawn_busy
        Plans among which a parent is chosen, by the area that its neighbours leave it divided by
        how often it has been a parent; and as long as the search is busy.
    p_reserve, slack
        With what probability a parent comes from the reserve, and how much less reward than the
        front, relative, a plan may have to get there: at least ``slack``, and with every parent
        ``slack`` / (1 − u), u drawn from [0, 1), so that now and then anything does.
    p_keep
        With what probability a parent's children may get to the reserve at all, as long as plans
        enter the front: what goes there costs as much as what enters.
    p_neighbour
        With what probability the other plan of a move is one near the parent: of its block of the
        front, or of one of the two beside that.
    p_end
        With what probability the parent is the plan of most reward.
    p_near, p_step, p_more, p_short, n_short, p_meet, p_detour
        See ``reconnect`` and ``combine``.
    patience
        After so many evaluations without a plan that enters, more parents come from the reserve,
        and what goes there is no question of ``p_keep``.
    p_alone, n_alone
        Then, too: with what probability the search goes on for ``n_alone`` evaluations from a front
        of trails of one robot of the parent's, the other robots' trails being fixed.
    n_first, n_hops, hops_each
        After how many evaluations best responses (``respond``) are looked for, sooner where nothing
        enters, the first to the plan of most survivors; hops after which a search for one is given
        up; and how many of them an evaluation earns, so that these searches take a certain share of
        the time. (The first search that takes too long, at an eighth of the hops, is free.)
    min_survival
        Survival floor of every robot.
    max_size
        Plans that the front keeps at most; 0 sets no limit.
    """

    n_children: int = 24
    n_children_busy: int = 8
    busy: int = 100
    p_newest: float = 0.9
    n_drawn: int = 2
    n_drawn_busy: int = 8
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
    p_alone: float = 0.1
    n_alone: int = 500
    n_first: int = 10_000
    n_hops: int = 150_000
    hops_each: float = 0.1
    min_survival: float = 0.0
    max_size: int = 0


@everywhere
def most_new(rule: SearchRule) -> int:
    """Give how many trails and plans a parent adds at most: its children, and one to spare.

    Parameters
    ----------
    rule
        How to search.
    """
    return max(rule.n_children, rule.n_children_busy) + 1


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
