"""Children of a parent: made by a move, and what they are expected to bring."""

from botohe_moo._base.types import FloatArray, SeedArray
from botohe_moo.kernels.compile import part
from botohe_moo.kernels.local_search.front import N_BLOCKS, Front, best_reward, draw_place
from botohe_moo.kernels.local_search.moves import (
    GRAFT,
    N_KINDS,
    SPLICE,
    SWAP_LOOPS,
    VISIT_TWO,
    combine,
    reconnect,
    reverse,
    swap_loops,
)
from botohe_moo.kernels.local_search.parent import (
    LENGTH,
    MARK,
    N_MIDDLE,
    PREFIX,
    SUFFIX,
    Ground,
    Workspace,
)
from botohe_moo.kernels.local_search.routes import Routes
from botohe_moo.kernels.local_search.rule import TOLERANCE, SearchRule
from botohe_moo.kernels.local_search.trail_store import TrailStore
from botohe_moo.kernels.rng import uniform

# How often a path may go round an arc that is used already.
_MAX_DETOURS = 4


@part
def draw_trail(front: Front, at: int, p_neighbour: float, states: SeedArray) -> int:
    """Draw a trail of another plan: of one near the parent, or of any."""
    n_blocks = front.counts[N_BLOCKS]
    if uniform(states, 0) < p_neighbour:
        at = min(n_blocks - 1, max(0, at + int(uniform(states, 0) * 3.0) - 1))
        place = int(uniform(states, 0) * front.size[front.directory[at]])
    else:
        at, place = draw_place(front, states)
    slot = front.slot[front.directory[at], place]
    return int(front.plan[slot, int(uniform(states, 0) * front.plan.shape[1])])


@part
def draw_kind(weights: FloatArray, states: SeedArray) -> int:
    """Draw a kind of move, by weights summed up to each."""
    drawn = uniform(states, 0) * weights[N_KINDS - 1]
    kind = 0
    while weights[kind] <= drawn and kind < N_KINDS - 1:
        kind += 1
    return kind


@part
def change(
    ground: Ground,
    routes: Routes,
    store: TrailStore,
    front: Front,
    work: Workspace,
    rule: SearchRule,
    kind: int,
    at: int,
    states: SeedArray,
) -> bool:
    """Make a child by a move; False where there is none, or it equals the trail."""
    n_detours = _MAX_DETOURS if uniform(states, 0) < rule.p_detour else 0
    if kind <= VISIT_TWO:
        made = reconnect(
            ground,
            routes,
            work,
            kind,
            rule.p_short,
            rule.n_short,
            rule.p_near,
            rule.p_step,
            rule.p_more,
            n_detours,
            states,
        )
    elif kind in (SPLICE, GRAFT):
        donor = draw_trail(front, at, rule.p_neighbour, states)
        made = combine(
            ground, routes, store, work, donor, kind == SPLICE, rule.p_meet, n_detours, states
        )
    elif kind == SWAP_LOOPS:
        made = swap_loops(work, states)
    else:
        made = reverse(ground, routes, work, rule.p_short, rule.n_short, n_detours, states)
    if not made:
        return False
    # An arc that the end of the trail has, too: the loop in between goes.
    now, middle = work.now, work.middle
    again = -1
    for i in range(now[N_MIDDLE]):
        if work.position[middle[i]] >= now[SUFFIX]:
            now[SUFFIX] = work.position[middle[i]] + 1
            again = i
    if again >= 0:
        now[N_MIDDLE] = again + 1
    if now[N_MIDDLE] != now[SUFFIX] - now[PREFIX]:
        return True
    for i in range(now[N_MIDDLE]):  # noqa: SIM110 - any() would make a generator
        if middle[i] != work.arc[now[PREFIX] + i]:
            return True
    return False


@part
def write_child(work: Workspace) -> int:
    """Write the child's arcs; give how many there are."""
    prefix, n_middle, suffix = work.now[PREFIX], work.now[N_MIDDLE], work.now[SUFFIX]
    for i in range(prefix):
        work.child[i] = work.arc[i]
    for i in range(n_middle):
        work.child[prefix + i] = work.middle[i]
    n = prefix + n_middle
    for i in range(suffix, work.now[LENGTH]):
        work.child[n] = work.arc[i]
        n += 1
    return int(n)


@part
def appraise(
    ground: Ground,
    front: Front,
    work: Workspace,
    min_survival: float,
    slack: float,
    others: float,
    survivors: float,
) -> tuple[float, float, float]:
    """Give a child's E[R] and E[S], and the reward that it has to exceed.

    The first is −1 where the child is too far from the front, or below the survival floor.

    Parameters
    ----------
    ground, front, work
        The mission, the front, and the child.
    min_survival
        Survival floor.
    slack
        How much less reward than the front, relative, the child may have.
    others, survivors
        E[R] and E[S] of the other robots.
    """
    now, left = work.now, work.left
    prefix, suffix, length = now[PREFIX], now[SUFFIX], now[LENGTH]
    now[MARK] += 1
    mark = now[MARK]
    alive, gained = work.alive[prefix], work.gained[prefix]
    for i in range(now[N_MIDDLE]):
        arc = work.middle[i]
        alive *= ground.survival[arc]
        node = ground.head[arc]
        if work.met[node] > prefix and work.seen[node] != mark:
            work.seen[node] = mark
            gained += left[node] * alive
    ratio = alive / work.alive[suffix]
    home = work.alive[length] * ratio
    if home < min_survival:
        return -1.0, 0.0, 0.0
    survivors += home
    needed = best_reward(front, survivors * (1.0 - TOLERANCE))
    bound = (others + gained + alive * work.ahead[suffix]) * (1.0 + TOLERANCE)
    if needed * (1.0 - slack) >= bound:
        return -1.0, survivors, needed
    for i in range(suffix + 1, length + 1):
        node = work.node[i]
        if work.met[node] > prefix and work.seen[node] != mark:
            work.seen[node] = mark
            gained += left[node] * work.alive[i] * ratio
    return others + gained, survivors, needed


@part
def adopt(
    store: TrailStore,
    front: Front,
    work: Workspace,
    trail: int,
    others: float,
    survivors: float,
) -> tuple[float, float, float]:
    """Give E[R] and E[S] of the plan in which the robot takes a stored trail; see ``appraise``."""
    gained = 0.0
    start = store.visits_from[trail]
    for i in range(start, start + store.n_visits[trail]):
        gained += work.left[store.node[i]] * store.reach[i]
    survivors += store.alive[trail]
    return others + gained, survivors, best_reward(front, survivors * (1.0 - TOLERANCE))
