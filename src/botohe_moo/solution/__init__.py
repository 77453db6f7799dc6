"""Solutions: what a search found, as tables and files, and read from them again."""

from botohe_moo.solution.model import PictureError, Solution
from botohe_moo.solution.reading import read_solution

__all__ = ["PictureError", "Solution", "read_solution"]
