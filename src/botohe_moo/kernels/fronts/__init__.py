"""Archives of non-dominated plans."""
