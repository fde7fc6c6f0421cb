"""How much is tried: 200 examples a test, 10,000 with ``pytest tests/fuzz --hypothesis-profile=nightly``."""

from __future__ import annotations

from hypothesis import HealthCheck, settings

SLOW = (HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much)
# derandomized: the same examples in every run of the continuous integration; the nightly run looks further
settings.register_profile("ci", max_examples=200, deadline=5000, derandomize=True, suppress_health_check=SLOW)
settings.register_profile("nightly", max_examples=10_000, deadline=5000, suppress_health_check=SLOW)
settings.load_profile("ci")
