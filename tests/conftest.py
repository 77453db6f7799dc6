"""Fixtures that several test modules share."""

from hypothesis import HealthCheck, settings

# Shared CI machines stall now and then: what counts is the result, never the time an example took.
settings.register_profile("botohe", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("botohe")
