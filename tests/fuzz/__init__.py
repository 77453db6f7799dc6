"""Fuzzing of everything that reads files: ``make fuzz``, or ``python -m tests.fuzz --help``."""
