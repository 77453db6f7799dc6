"""Samplings: plans to start from."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from pymoo.core.sampling import Sampling

from botohe_moo.algorithms.bo_aco.algorithm import (
    JOURNAL_BONUS,
    JOURNAL_EXPLORATION,
    Colony,
    ColonySettings,
)
from botohe_moo.algorithms.greedy.planner import SequentialPlanner
from botohe_moo.base.parameters import check
from botohe_moo.base.types import ObjectArray, Rng
from botohe_moo.operators.variation import Mixture, check_part
from botohe_moo.problem import BOTOHE
from botohe_moo.trails import PlanBatch, TrailPlan, listed_plans


class PlanSampling(Sampling):
    """A pymoo sampling of valid trail plans, which keep the problem's limits.

    Examples
    --------
    >>> from botohe_moo import solve
    >>> from botohe_moo.algorithms import PlanSampling
    >>> from botohe_moo.trails import PlanBatch
    >>> class AtHome(PlanSampling):
    ...     '''Everybody stays at base.'''
    ...     def _sample(self, problem, n_samples, rng):
    ...         home = problem.mission.stay_home()
    ...         return PlanBatch.from_plans([home] * n_samples, problem.mission.robots)
    >>> solve("toy", "nsga2", sampling=AtHome(), pop_size=20, evaluations=200).evaluations
    200
    """

    rest: "PlanSampling | None" = None
    """What samples the plans that are missing."""

    def sample_batch(self, problem: BOTOHE, n_samples: int, random_state: Rng) -> PlanBatch:
        """Return plans to start from.

        Parameters
        ----------
        problem
            What to plan for.
        n_samples
            How many plans are wanted, at least 1; :class:`GivenSampling` may give more.
        random_state
            Where all random numbers come from.
        """
        n_samples = check("n_samples", n_samples, int, ge=1)
        plans = self._sample(problem, n_samples, random_state)
        if self.rest is not None and len(plans) < n_samples:
            others = self.rest.sample_batch(problem, n_samples - len(plans), random_state)
            return PlanBatch.concatenate([plans, others])
        if len(plans) < n_samples:
            expected = f"_sample of {type(self).__name__} to give {n_samples} plans"
            raise ValueError(f"Expected {expected}, got {len(plans)}.")
        return plans

    def _sample(self, problem: BOTOHE, n_samples: int, rng: Rng) -> PlanBatch:
        """Return ``n_samples`` valid plans, or more."""
        raise NotImplementedError

    def _do(
        self, problem: BOTOHE, n_samples: int, *_: Any, random_state: Rng, **__: Any
    ) -> ObjectArray:
        return self.sample_batch(problem, n_samples, random_state).to_array()


class RandomTrailSampling(PlanSampling):
    """Random trails: every arc that a trail has not used yet is equally likely.

    At base the end of the trail is as likely as each arc. An arc is not taken if no way home within
    the limits is found behind it.

    Examples
    --------
    >>> import numpy as np
    >>> from botohe_moo import BOTOHE, load_mission
    >>> from botohe_moo.algorithms import RandomTrailSampling
    >>> problem = BOTOHE(load_mission("toy"))
    >>> len(RandomTrailSampling().sample_batch(problem, 5, np.random.default_rng(1)))
    5
    """

    def _sample(self, problem: BOTOHE, n_samples: int, rng: Rng) -> PlanBatch:
        return _walk(problem, n_samples, rng, heuristic=False)


class GuidedTrailSampling(PlanSampling):
    """Trails of ants without pheromone, their weights spread evenly from reward to survival.

    The heuristic is that of :meth:`BOACO.journal`.

    Examples
    --------
    >>> import numpy as np
    >>> from botohe_moo import BOTOHE, load_mission
    >>> from botohe_moo.algorithms import GuidedTrailSampling
    >>> problem = BOTOHE(load_mission("toy"))
    >>> len(GuidedTrailSampling().sample_batch(problem, 5, np.random.default_rng(1)))
    5
    """

    def _sample(self, problem: BOTOHE, n_samples: int, rng: Rng) -> PlanBatch:
        return _walk(problem, n_samples, rng, heuristic=True)


def _walk(problem: BOTOHE, n_samples: int, rng: Rng, *, heuristic: bool) -> PlanBatch:
    """Let ants without pheromone build plans."""
    settings = ColonySettings(
        n_ants=n_samples,
        heuristic=heuristic,
        pheromone=False,
        unvisited_bonus=JOURNAL_BONUS,
        exploration=JOURNAL_EXPLORATION,
    )
    return Colony(problem.mission, problem.world, settings, random_state=rng).construct(n_samples)


class _FilledSampling(PlanSampling):
    """A sampling of few plans."""

    def __init__(self, rest: PlanSampling | None = None) -> None:
        super().__init__()
        self.rest = check_part("rest", rest, PlanSampling, GuidedTrailSampling)


class CornerSampling(_FilledSampling):
    """The corners of the front: everybody stays home, and the greedy plan for reward alone.

    Parameters
    ----------
    rest
        The sampling of the other plans that are wanted; default: :class:`GuidedTrailSampling`.

    Examples
    --------
    >>> import numpy as np
    >>> from botohe_moo import BOTOHE, load_mission
    >>> from botohe_moo.algorithms import CornerSampling
    >>> problem = BOTOHE(load_mission("toy"))
    >>> corners = CornerSampling().sample_batch(problem, 2, np.random.default_rng(1))
    >>> problem.mission.evaluate(corners).round(2).tolist()  # all survive; most reward
    [[0.0, 2.0], [9.01, 0.7]]
    """

    def _sample(self, problem: BOTOHE, n_samples: int, rng: Rng) -> PlanBatch:  # noqa: ARG002
        mission, world = problem.mission, problem.world
        home = mission.stay_home(world)
        greedy = SequentialPlanner(mission, world).plan(1.0)
        return PlanBatch.from_plans([home, greedy][:n_samples], mission.robots)


class GivenSampling(_FilledSampling):
    """Given plans, and others where they are too few.

    All given plans are used, even if fewer are wanted or they do not keep the limits.

    Parameters
    ----------
    plans
        Trail plans, or ``X`` or the population of another result. Sampling raises a PlanError if
        one is not valid.
    rest
        The sampling of the other plans that are wanted; default: :class:`GuidedTrailSampling`.

    Examples
    --------
    >>> import numpy as np
    >>> from botohe_moo import BOTOHE, load_mission
    >>> from botohe_moo.algorithms import GivenSampling
    >>> problem = BOTOHE(load_mission("toy"))
    >>> plan = problem.mission.plan([[1, 2, 1], [1]])
    >>> batch = GivenSampling([plan]).sample_batch(problem, 5, np.random.default_rng(1))
    >>> len(batch), batch[0] == plan
    (5, True)
    """

    def __init__(
        self, plans: Iterable[TrailPlan] | ObjectArray, rest: PlanSampling | None = None
    ) -> None:
        super().__init__(rest)
        self.plans = listed_plans(plans)

    def _sample(self, problem: BOTOHE, n_samples: int, rng: Rng) -> PlanBatch:  # noqa: ARG002
        given = problem.mission.batch(self.plans)
        if not problem.allow_invalid:
            problem.mission.evaluate(given)
        return given


class MixedSampling(PlanSampling):
    """Plans of several samplings.

    Parameters
    ----------
    samplings
        Samplings, or a mapping from them to weights (above 0). A sampling is drawn for each plan.

    Examples
    --------
    >>> import numpy as np
    >>> from botohe_moo import BOTOHE, load_mission
    >>> from botohe_moo.algorithms import GuidedTrailSampling, MixedSampling, RandomTrailSampling
    >>> problem = BOTOHE(load_mission("toy"))
    >>> sampling = MixedSampling({GuidedTrailSampling(): 3, RandomTrailSampling(): 1})
    >>> len(sampling.sample_batch(problem, 20, np.random.default_rng(1)))
    20
    """

    def __init__(self, samplings: Sequence[PlanSampling] | Mapping[PlanSampling, float]) -> None:
        super().__init__()
        self.mixture = Mixture("sampling", PlanSampling, samplings)

    def _sample(self, problem: BOTOHE, n_samples: int, rng: Rng) -> PlanBatch:
        shares = self.mixture.draw(rng, n_samples)
        return PlanBatch.concatenate(
            [part.sample_batch(problem, len(chosen), rng) for part, chosen in shares]
        )
