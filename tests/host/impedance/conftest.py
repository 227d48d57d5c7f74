"""Campaigns of the independent plant, integrated once for all tests."""

import pytest
from impid_host.study.model import Study

from .plant import Load, Motion, Noise, make_study, simulate


@pytest.fixture(scope="session")
def truth() -> Load:
    return Load()


@pytest.fixture(scope="session")
def motions(truth: Load) -> dict[str, Motion]:
    """Two free and two mass-spring motions of 26 s."""
    free = {f"free_0{k}": simulate(k, 26.0) for k in (1, 2)}
    shaken = {f"spring_K1_M2_0{k}": simulate(10 + k, 26.0, load=truth, span_deg=10.0) for k in (1, 2)}
    return free | shaken


@pytest.fixture(scope="session")
def study(motions: dict[str, Motion]) -> Study:
    """The campaign with realistic noise."""
    return make_study(motions, Noise())


@pytest.fixture(scope="session")
def clean_study(motions: dict[str, Motion]) -> Study:
    """The same without noise, counting apart."""
    return make_study(motions, Noise(0.0, 0.0, 0.0))
