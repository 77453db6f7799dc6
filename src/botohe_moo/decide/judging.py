"""Plans to choose from, judged by wishes."""

from botohe_moo.decide.fronts import SLACK
from botohe_moo.decide.wishes import (
    QUANTITIES,
    Chance,
    EveryRobot,
    Expected,
    Quantity,
    Reach,
    TailMean,
    Wish,
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
        self._weakest_robot = mission.robot_survival(self.batch).min(axis=1)
        self._rewards: dict[int, Distribution] = {}

    def __len__(self) -> int:
        return len(self.plans)

    def value(self, wish: Wish, i: int) -> float:
        """Compute the value of plan ``i`` that a wish limits."""
        match wish:
            case Expected(quantity=quantity):
                return float(self.objectives[i, QUANTITIES.index(quantity)])
            case Chance(quantity=quantity, value=value):
                return self.distribution(quantity, i).at_least(value)
            case TailMean(quantity=quantity, alpha=alpha):
                return self.distribution(quantity, i).cvar(alpha)
            case EveryRobot():
                return float(self._weakest_robot[i])
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
        if isinstance(wish, Expected | TailMean):
            return self._most(wish.quantity) or 1.0
        return 1.0

    def beyond(self, wish: Wish) -> Quantity | None:
        """Return the quantity of which a wish needs more than any plan can have, or None."""
        if isinstance(wish, Expected | TailMean):
            needed = wish.at_least
        elif isinstance(wish, Chance) and wish.at_least > SLACK:
            needed = wish.value
        else:
            return None
        most = self._most(wish.quantity)
        return wish.quantity if needed > most + SLACK * (most or 1.0) else None

    def _most(self, quantity: Quantity) -> float:
        return self.mission.total_reward if quantity == "reward" else float(self.mission.robots)

    @property
    def simulated(self) -> bool:
        """Whether some plan's distribution of the reward had to be simulated."""
        return not all(found.exact for found in self._rewards.values())

    def distribution(self, quantity: Quantity, i: int) -> Distribution:
        """Compute the distribution of the reward or the survivors of plan ``i``."""
        if quantity == "survivors":
            return survivors_distribution(self.mission, self.plans[i])
        if i not in self._rewards:
            limits = {"max_outcomes": MAX_OUTCOMES, "n_samples": N_SAMPLES}
            self._rewards[i] = reward_distribution(
                self.mission, self.plans[i], **limits, random_state=SEED
            )
        return self._rewards[i]


def takes_reward_distribution(wish: Wish) -> bool:
    """Return whether a wish is judged by the distribution of the reward."""
    return isinstance(wish, Chance | TailMean) and wish.quantity == "reward"
