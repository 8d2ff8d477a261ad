"""Settings of Hypothesis: the same examples every time, more of them in slow tests."""

import os

import pytest

hypothesis = pytest.importorskip("hypothesis")

hypothesis.settings.register_profile(
    "quick", max_examples=60, stateful_step_count=25, deadline=None, derandomize=True,
    suppress_health_check=list(hypothesis.HealthCheck),
)  # fmt: skip
hypothesis.settings.register_profile(
    "fuzz", parent=hypothesis.settings.get_profile("quick"), max_examples=5000, derandomize=False
)
hypothesis.settings.load_profile(os.environ.get("NCRS_FUZZ", "quick"))
