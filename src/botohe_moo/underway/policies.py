"""What replanning is worth: missions that are played, with plans that stay or are made anew."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from botohe_moo.base.messages import check_integer
from botohe_moo.decide.fronts import short_text
from botohe_moo.mission.model import Mission
from botohe_moo.trails import TrailPlan
from botohe_moo.underway.playing import Policy, play, policies_of

if TYPE_CHECKING:
    import pandas as pd

_AT_ONCE = 25  # missions that a worker plays before it says so


@dataclass(frozen=True)
class PolicyOutcomes:
    """What came of missions that were played under some policies.

    Attributes
    ----------
    mission, plan
        The mission and the plan with which each starts.
    price
        What a survivor is worth, as reward.
    played
        A row for each policy and mission that was played, with the columns ``policy``, ``mission``
        (its number), ``reward``, ``survivors``, ``replans`` and ``seconds`` (of all replans). Where
        a share is not 1, the reward is to be expected.

    Examples
    --------
    >>> from botohe_moo import load_mission, simulate_policy
    >>> from botohe_moo.underway import PolicyOutcomes
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1, 3, 1]])
    >>> outcomes = simulate_policy(toy, plan, "losses", price=2, missions=20)
    >>> isinstance(outcomes, PolicyOutcomes), len(outcomes.played)
    (True, 40)
    """

    mission: Mission
    plan: TrailPlan
    price: float
    played: pd.DataFrame

    @property
    def table(self) -> pd.DataFrame:
        """A row for each policy: means of missions, and what they are worth.

        The columns are ``policy``, ``reward``, ``survivors``, ``gain`` (what a mission is worth
        more than with the plan as it is, at the price), ``gain_se`` (its standard error),
        ``replans`` (of a mission) and ``seconds`` (of a replan).
        """
        import pandas as pd

        worth = self.played["reward"] + self.price * self.played["survivors"]
        by_policy = self.played.assign(worth=worth).groupby("policy", sort=False)
        base = by_policy.get_group("static")["worth"].to_numpy()
        rows = []
        for name, played in by_policy:
            gains, replans = played["worth"].to_numpy() - base, played["replans"].sum()
            rows.append(
                {
                    "policy": name,
                    "reward": played["reward"].mean(),
                    "survivors": played["survivors"].mean(),
                    "gain": gains.mean(),
                    "gain_se": gains.std(ddof=1) / len(gains) ** 0.5,
                    "replans": played["replans"].mean(),
                    "seconds": played["seconds"].sum() / max(1, replans),
                }
            )
        return pd.DataFrame(rows)

    def __str__(self) -> str:
        price = f"A robot more costs {short_text(self.price)} reward."
        return f"{price}\n{self.table.round(4).to_string(index=False)}"


def simulate_policy(
    mission: Mission,
    plan: TrailPlan,
    policy: str | Sequence[str] = ("losses", "one by one"),
    *,
    price: float | None = None,
    missions: int = 1_000,
    seed: int = 1,
    evaluations: int = 400,
    min_survival: float = 0.0,
    max_length: float | None = None,
    workers: int = 1,
    progress: Callable[[int], None] | None = None,
) -> PolicyOutcomes:
    """Play missions under policies of replanning, and with the plan as it is.

    All policies meet the same dangers: hop i of robot k is survived if a number, drawn once for
    each mission, robot and hop, is less than the survival of its arc.

    Parameters
    ----------
    mission, plan
        A mission, and a plan of it.
    policy
        When a plan is made anew, one or more of: ``"losses"``, after each; ``"arrivals"``, whenever
        robots get to a node; ``"one by one"``, where robots go one after another, that with most
        hops first, and each is planned for when the one before is home or lost;
        ``"shortest first"``, the same, but that with fewest hops goes first; ``"static"``, never,
        which is always played.
    price
        What a survivor is worth, as reward; default: what the plan implies, as for :func:`replan`.
    missions
        How many are played under each policy, at least 2.
    seed
        Seed of all random numbers, at least 0.
    evaluations
        Of each replan, at least 0.
    min_survival, max_length
        The limits of the plan, as for :func:`botohe_moo.underway.under_way`.
    workers
        Processes that play missions, at least 1; the outcomes do not depend on their number. In a
        script, more than one need ``if __name__ == "__main__":``.
    progress
        Called with the number of missions played, whenever some have been.

    Raises
    ------
    ValueError
        If a policy is unknown, or a parameter is out of its range.
    PlanError
        If the plan is not valid for the mission, or does not keep the limits.

    Examples
    --------
    >>> from botohe_moo import load_mission, simulate_policy
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1, 3, 1]])
    >>> outcomes = simulate_policy(toy, plan, "losses", price=2, missions=20)
    >>> outcomes.table["policy"].tolist()
    ['static', 'losses']
    """
    import pandas as pd

    names = [policy] if isinstance(policy, str) else list(policy)
    names = list(dict.fromkeys(["static", *names]))
    missions = check_integer("missions", missions, at_least=2)
    seed = check_integer("seed", seed, at_least=0)
    workers = check_integer("workers", workers, at_least=1)
    given = evaluations, min_survival, max_length
    policies = policies_of(mission, plan, names, price, *given)
    blocks = [range(i, min(i + _AT_ONCE, missions)) for i in range(0, missions, _AT_ONCE)]
    play_block = partial(_play_missions, mission, policies, seed)
    with ExitStack() as stack:
        results: Iterable[list[dict[str, object]]] = map(play_block, blocks)
        if workers > 1 and len(blocks) > 1:
            context = multiprocessing.get_context("spawn")
            pool = ProcessPoolExecutor(min(workers, len(blocks)), mp_context=context)
            results = stack.enter_context(pool).map(play_block, blocks)
        rows = []
        for block, found in zip(blocks, results, strict=True):
            rows += found
            if progress is not None:
                progress(block.stop)
    played = pd.DataFrame(rows)
    order = played["policy"].map(names.index)
    played = played.iloc[np.argsort(order, kind="stable")].reset_index(drop=True)
    return PolicyOutcomes(mission, plan, policies[0].price, played)


def _play_missions(
    mission: Mission,
    policies: Sequence[Policy],
    seed: int,
    numbers: Iterable[int],
) -> list[dict[str, object]]:
    """Play some missions under each policy, by their numbers."""
    rows = []
    for number in numbers:
        for policy in policies:
            played = play(mission, policy, seed, number)
            rows.append({"policy": policy.name, "mission": number, **played._asdict()})
    return rows
