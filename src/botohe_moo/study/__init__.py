"""Comparative studies: from one YAML file to tables, statistics and figures."""
