"""The exact front: kernels and searches."""
