"""Mission files, one format a module."""
