"""Random walks against the kinds of noise that they must not be taken for."""

from typing import Any

import numpy as np
import pytest
from impid_host.diagnosis.wander import wandering
from scipy.signal import lfilter

from .synthetic import STEP_S, Rows

TAPS = {("torque", 0): np.ones(1)}


def found(seed: int, make) -> list[Any]:
    own = Rows([], seed=seed, count=800)
    noise = np.stack([make(own.rng) for _ in range(4)])[None]
    return wandering(own.table(own.target({}, noise=0.0) + noise), [], TAPS)


def pink(rng) -> np.ndarray:
    spectrum = np.fft.rfft(rng.standard_normal(1600))
    return np.fft.irfft(spectrum / np.sqrt(np.maximum(np.arange(801), 1)), 1600)[:800] * 10


@pytest.mark.parametrize(
    ("name", "make"),
    [
        ("white", lambda rng: rng.standard_normal(800)),
        ("1/f", pink),
        # Flat below 1 Hz, and falling with the square of frequency above it, as a walk does.
        (
            "corner at 1 Hz",
            lambda rng: lfilter([1.0], [1.0, -np.exp(-2 * np.pi * STEP_S)], rng.standard_normal(900))[100:],
        ),
    ],
)
def test_ordinary_noise_does_not_wander(name: str, make) -> None:
    assert sum(bool(found(seed, make)) for seed in range(20)) == 0, name


def test_a_random_walk_beside_white_noise_is_said_with_its_course() -> None:
    walk = lambda rng: np.cumsum(0.3 * rng.standard_normal(800)) + rng.standard_normal(800)  # noqa: E731
    (entry,) = found(1, walk)
    assert (entry.variable, entry.on) == ("time", "tau1")
    assert "wanders slowly" in entry.words
    slope = float(entry.words.split("f to the ")[1].split(")")[0])
    assert slope == pytest.approx(2.0, abs=0.35)
    assert entry.share > 0.5
