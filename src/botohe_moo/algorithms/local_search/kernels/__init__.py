"""Kernels of the Pareto local search."""
