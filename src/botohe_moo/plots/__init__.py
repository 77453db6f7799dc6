"""Pictures of missions, plans, fronts, pheromone and studies: one function each.

Names are imported when they are first used: pictures of studies need more than those of a mission.
"""

from typing import TYPE_CHECKING

from botohe_moo._base.lazy import lazy_names

if TYPE_CHECKING:
    from botohe_moo.plots.draw.algorithms import AlgorithmStyle, algorithm_styles
    from botohe_moo.plots.draw.style import save_figure, save_plot, theme
    from botohe_moo.plots.front import plot_front
    from botohe_moo.plots.mission import plot_mission
    from botohe_moo.plots.pheromone import plot_pheromone
    from botohe_moo.plots.study.areas import plot_areas
    from botohe_moo.plots.study.attainment import plot_attainment
    from botohe_moo.plots.study.curves import plot_curves
    from botohe_moo.plots.study.difference import plot_attainment_difference
    from botohe_moo.plots.study.fronts import plot_fronts
    from botohe_moo.plots.study.heat import plot_heat
    from botohe_moo.plots.study.ranks import plot_ranks
    from botohe_moo.plots.study.reached import plot_reached

__all__ = [
    "AlgorithmStyle",
    "algorithm_styles",
    "plot_areas",
    "plot_attainment",
    "plot_attainment_difference",
    "plot_curves",
    "plot_front",
    "plot_fronts",
    "plot_heat",
    "plot_mission",
    "plot_pheromone",
    "plot_ranks",
    "plot_reached",
    "save_figure",
    "save_plot",
    "theme",
]

_HOMES = {
    ".draw.algorithms": ("AlgorithmStyle", "algorithm_styles"),
    ".draw.style": ("save_figure", "save_plot", "theme"),
    ".front": ("plot_front",),
    ".mission": ("plot_mission",),
    ".pheromone": ("plot_pheromone",),
    ".study.areas": ("plot_areas",),
    ".study.attainment": ("plot_attainment",),
    ".study.curves": ("plot_curves",),
    ".study.difference": ("plot_attainment_difference",),
    ".study.fronts": ("plot_fronts",),
    ".study.heat": ("plot_heat",),
    ".study.ranks": ("plot_ranks",),
    ".study.reached": ("plot_reached",),
}
__getattr__, __dir__ = lazy_names(__name__, _HOMES)
