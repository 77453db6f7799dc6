"""Paths over a mission's arcs."""
