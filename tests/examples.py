"""How many examples property tests draw: half of those they state, forty times as many at length.

``make test-long`` sets BOTOHE_EXAMPLES, the share of them. Each run draws others.
"""

import os

from hypothesis import settings

SHARE = float(os.environ.get("BOTOHE_EXAMPLES", "0.5"))


def examples(n, **options):
    """Settings of a property test that is to see so many examples, times the share."""
    return settings(max_examples=max(1, round(n * SHARE)), **options)
