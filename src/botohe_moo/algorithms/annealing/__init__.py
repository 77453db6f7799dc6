"""Simulated annealing: kernels, engine and the pymoo class."""
