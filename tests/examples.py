"""How many examples property tests draw, as a share of those that they state.

BOTOHE_EXAMPLES sets it: a tenth in ``make test`` and three tenths in ``make test-all``, which draw
the same ones each time, and twenty times as many in ``make test-long``, which draws others each
time.
"""

import os

import pytest
from hypothesis import settings

SHARE = float(os.environ.get("BOTOHE_EXAMPLES", "0.3"))


def examples(n, **options):
    """Settings of a property test that is to see so many examples, times the share."""
    return settings(max_examples=max(1, round(n * SHARE)), **options)


def seeds(few, n):
    """Seeds of random missions: ``few`` in ``make test``, and twice the share of ``n`` others."""
    others = range(few, few + round(2 * n * SHARE))
    return [range(few), pytest.param(others, marks=[pytest.mark.slow, pytest.mark.seeds])]
