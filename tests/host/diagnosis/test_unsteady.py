"""What stands out in one part of a study, on noise of known power."""

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from impid_host.diagnosis.rows import Run
from impid_host.diagnosis.unsteady import unsteady
from impid_host.effects.view import View

_TRIALS = ("free_01", "free_02", "load_01", "load_02")
_TAPS = {("torque", 0): np.array([1.0])}


def _study(
    seed: int, power: dict[tuple[str, str], float], speed: dict[str, float]
) -> tuple[list[Run], list[View]]:
    """White rows of one channel, power 1 but where given; one column that is truly there."""
    rng = np.random.default_rng(seed)
    runs = []
    for trial in _TRIALS:
        for part, begin, rows in (("fit", 0.0, 200), ("validation", 21.0, 100)):
            design = rng.standard_normal((rows, 1))
            noise = rng.standard_normal(rows) * np.sqrt(power.get((trial, part), 1.0))
            runs.append(Run(trial, "torque", 0, part, begin, 0.1, 3.0 * design[:, 0] + noise, design))
    views = [SimpleNamespace(name=trial, omega=np.full((10, 1), speed.get(trial, 1.0))) for trial in _TRIALS]
    return runs, cast(list[View], views)


def test_even_noise_is_silent() -> None:
    assert not any(unsteady(runs, _TAPS, 1, views) for runs, views in (_study(k, {}, {}) for k in range(40)))


def test_a_part_that_stands_out_is_a_change_in_time() -> None:
    runs, views = _study(1, {("free_02", "validation"): 9.0}, {})
    (found,) = unsteady(runs, _TAPS, 1, views)
    assert (found.variable, found.on) == ("time", "tau1")
    assert "free_02" in found.words
    assert found.share == pytest.approx(8.0 * 100 / (1200 + 8.0 * 100), abs=0.05)


def test_a_whole_trial_is_named() -> None:
    runs, views = _study(2, {("load_01", "fit"): 9.0, ("load_01", "validation"): 9.0}, {})
    (found,) = unsteady(runs, _TAPS, 1, views)
    assert found.variable == "one_trial"
    assert "load_01" in found.words
    assert "free" not in found.words


def test_a_quicker_trial_may_be_noisier() -> None:
    runs, views = _study(3, {("load_01", "fit"): 9.0, ("load_01", "validation"): 9.0}, {"load_01": 3.0})
    assert not unsteady(runs, _TAPS, 1, views)
