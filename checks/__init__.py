"""Checks that take minutes: ``make dist``, ``make compatibility``, ``make mutations``."""
