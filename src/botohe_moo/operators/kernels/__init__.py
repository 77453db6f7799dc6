"""Kernels of operators."""
