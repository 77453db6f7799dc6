"""Pictures of missions, plans, fronts, pheromone and studies: one function each.

Names are imported when they are first used: pictures of studies need more than those of a mission.
"""

from typing import TYPE_CHECKING

from botohe_moo.base.runtime import lazy_names

if TYPE_CHECKING:
    from botohe_moo.plots.comparisons import plot_areas as plot_areas
    from botohe_moo.plots.comparisons import plot_curves as plot_curves
    from botohe_moo.plots.comparisons import plot_heat as plot_heat
    from botohe_moo.plots.comparisons import plot_ranks as plot_ranks
    from botohe_moo.plots.comparisons import plot_reached as plot_reached
    from botohe_moo.plots.comparisons import plot_shortfalls as plot_shortfalls
    from botohe_moo.plots.front import plot_attainment as plot_attainment
    from botohe_moo.plots.front import plot_attainment_difference as plot_attainment_difference
    from botohe_moo.plots.front import plot_front as plot_front
    from botohe_moo.plots.front import plot_fronts as plot_fronts
    from botohe_moo.plots.front import plot_pairs as plot_pairs
    from botohe_moo.plots.mission import plot_mission as plot_mission
    from botohe_moo.plots.mission import plot_pheromone as plot_pheromone
    from botohe_moo.plots.outcomes import plot_outcomes as plot_outcomes
    from botohe_moo.plots.outcomes import plot_policies as plot_policies
    from botohe_moo.plots.plan import plot_choices as plot_choices
    from botohe_moo.plots.plan import plot_plan as plot_plan
    from botohe_moo.plots.plan import plot_replan as plot_replan
    from botohe_moo.plots.plan import plot_scenarios as plot_scenarios
    from botohe_moo.plots.style import save_figure as save_figure
    from botohe_moo.plots.style import save_plot as save_plot
    from botohe_moo.plots.style import theme as theme

__getattr__, __dir__, __all__ = lazy_names(__name__)
