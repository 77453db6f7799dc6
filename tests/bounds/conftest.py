"""Fixtures that tests of bounds share."""

import pytest

from botohe_moo.bounds import proof, schedule


@pytest.fixture
def short_search(monkeypatch):
    """On missions of a few nodes, more evaluations and cells find the same plans and bounds."""
    monkeypatch.setattr(proof, "_EVALUATIONS", 8_000)
    monkeypatch.setattr(schedule, "_MOST_ROUNDS", 3)


@pytest.fixture
def no_front(monkeypatch):
    """Small missions as if they were large: without looking for their true fronts."""
    monkeypatch.setattr(proof.Proof, "find_front", lambda _: False)
