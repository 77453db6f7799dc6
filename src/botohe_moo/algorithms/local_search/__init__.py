"""Pareto local search: kernels, engine, islands and the pymoo class."""
