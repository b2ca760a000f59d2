"""Figures from logs: data in, Figure out. Nothing here simulates, saves or changes global state."""

from skyarm.figures.figure_list import PAPER_CATALOGUE
from skyarm.figures.interactive import damping_figure, experiment_figure, tool_path_figure
from skyarm.figures.paper_figures import paper_figures

__all__ = [
    "PAPER_CATALOGUE",
    "damping_figure",
    "experiment_figure",
    "paper_figures",
    "tool_path_figure",
]
