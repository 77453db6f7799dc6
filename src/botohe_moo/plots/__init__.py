"""Pictures of missions, plans, fronts, pheromone and studies: one function each."""

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
