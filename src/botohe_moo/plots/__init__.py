"""Pictures of missions, plans, fronts and pheromone: one function each."""

from botohe_moo.plots.front import plot_front
from botohe_moo.plots.mission import plot_mission
from botohe_moo.plots.pheromone import plot_pheromone
from botohe_moo.plots.style import save_figure, save_plot, theme

__all__ = ["plot_front", "plot_mission", "plot_pheromone", "save_figure", "save_plot", "theme"]
