"""Plans to choose from, judged by wishes."""

from botohe_moo.base.messages import counted, quoted
from botohe_moo.decide.fronts import SLACK
from botohe_moo.decide.losses import worst_losses
from botohe_moo.decide.wishes import (
    QUANTITIES,
    Chance,
    EveryRobot,
    Expected,
    Quantity,
    Reach,
    TailMean,
    Wish,
    WorstCase,
    exact_text,
)
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.outcomes import (
    Distribution,
    reach_probabilities,
    reward_distribution,
    survivors_distribution,
    team_reach,
)
from botohe_moo.trails import Plans

MAX_OUTCOMES = 100_000  # joint outcomes; the reward of a plan with more is simulated
N_SAMPLES = 10_000  # missions of a simulation
SEED = 1


class Candidates:
    """Plans of one mission; distributions of rewards are computed when they are first needed."""

    def __init__(self, mission: Mission, plans: Plans) -> None:
        self.mission = mission
        self.batch = check_mission(mission).batch(plans)
        self.plans = tuple(self.batch)
        if not self.plans:
            raise ValueError("Expected at least one plan to choose from, got none.")
        self.objectives = mission.evaluate(self.batch)
        self._survival = mission.robot_survival(self.batch)
        self._rewards: dict[int, Distribution] = {}

    def __len__(self) -> int:
        return len(self.plans)

    def value(self, wish: Wish, i: int) -> float:
        """Compute the value of plan ``i`` that a wish limits."""
        match wish:
            case Expected(quantity=quantity, kind=None):
                return float(self.objectives[i, QUANTITIES.index(quantity)])
            case Expected(kind=kind):
                counts = [of.name == kind for of in self.mission.kind_of]
                return float(self._survival[i, counts].sum())
            case Chance(quantity=quantity, value=value, kind=kind):
                return self.distribution(quantity, i, kind).at_least(value)
            case TailMean(quantity=quantity, alpha=alpha, kind=kind):
                return self.distribution(quantity, i, kind).cvar(alpha)
            case WorstCase(losses=losses):
                return worst_losses(self.mission, self.plans[i], losses)[0]
            case EveryRobot():
                return float(self._survival[i].min())
            case Reach(node=node):
                reached = team_reach(reach_probabilities(self.mission, self.plans[i]))
                return float(reached[self.mission.index(node)])
        raise TypeError(f"Expected a wish of this package, got {wish!r}.")

    def missing(self, wish: Wish, i: int) -> float:
        """Compute the shortfall of plan ``i``; 0 if it meets the wish."""
        lacking = wish.at_least - self.value(wish, i)
        return lacking if lacking > SLACK * self.span(wish) else 0.0

    def span(self, wish: Wish) -> float:
        """Return the range of what a plan can have, by which shortfalls are scaled."""
        if isinstance(wish, Expected | TailMean | WorstCase):
            return self._most(wish) or 1.0
        return 1.0

    def beyond(self, wish: Wish) -> str | None:
        """Write what the mission has, if a wish needs more than any plan can have; else None."""
        if isinstance(wish, Expected | TailMean | WorstCase):
            needed = wish.at_least
        elif isinstance(wish, Chance) and wish.at_least > SLACK:
            needed = wish.value
        else:
            return None
        most = self._most(wish)
        if needed <= most + SLACK * (most or 1.0):
            return None
        if wish.quantity == "reward":
            return f"a total reward of {exact_text(most)}"
        of_kind = "" if wish.kind is None else f" of kind {quoted(wish.kind)}"
        return counted(int(most), "robot") + of_kind

    def _most(self, wish: Expected | Chance | TailMean | WorstCase) -> float:
        if wish.quantity == "reward":
            return self.mission.total_reward
        return float(sum(k.robots for k in self.mission.kinds if wish.kind in (None, k.name)))

    @property
    def simulated(self) -> bool:
        """Whether some plan's distribution of the reward had to be simulated."""
        return not all(found.exact for found in self._rewards.values())

    def distribution(self, quantity: Quantity, i: int, kind: str | None = None) -> Distribution:
        """Compute the distribution of the reward or the survivors, of a kind, of plan ``i``."""
        if quantity == "survivors":
            return survivors_distribution(self.mission, self.plans[i], kind=kind)
        if i not in self._rewards:
            limits = {"max_outcomes": MAX_OUTCOMES, "n_samples": N_SAMPLES}
            self._rewards[i] = reward_distribution(
                self.mission, self.plans[i], **limits, random_state=SEED
            )
        return self._rewards[i]


def takes_reward_distribution(wish: Wish) -> bool:
    """Return whether a wish is judged by the distribution of the reward."""
    return isinstance(wish, Chance | TailMean) and wish.quantity == "reward"
