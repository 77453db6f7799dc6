"""The ``botohe`` command: a thin layer over the library."""

from botohe_moo.cli.app import app, main

__all__ = ["app", "main"]
