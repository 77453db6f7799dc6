"""Compiled kernels: arrays in, arrays out; they know no pymoo, pandas or networkx."""
