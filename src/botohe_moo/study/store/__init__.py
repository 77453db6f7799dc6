"""A study's folder: its runs and its tables."""
