"""What stands out in one part of a study, on noise of known power."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from impid_host.diagnosis.result import Structure
from impid_host.diagnosis.unsteady import unsteady
from impid_host.effects.view import View

from .synthetic import Rows, term

TRIALS = 4


def found(seed: int, power: dict[tuple[int, int], float], speed: dict[int, float]) -> list[Structure]:
    """Noise of power 1 but in the given halves of trials, beside one column that is truly there."""
    rows = Rows([term("friction.coulomb", "joint1")], seed=seed, trials=TRIALS, count=300)
    target = rows.target({"friction.coulomb@joint1": 3.0}, noise=0.0)
    noise = rows.rng.standard_normal(target.shape)
    for (trial, half), level in power.items():
        noise[0, trial, 150 * half : 150 * (half + 1)] *= np.sqrt(level)
    views = [
        SimpleNamespace(name=f"free_{k + 1:02d}", omega=np.full((10, 1), speed.get(k, 1.0)))
        for k in range(TRIALS)
    ]
    return unsteady(rows.table(target + noise), [0], cast(list[View], views))


def test_even_noise_is_silent() -> None:
    assert not any(found(seed, {}, {}) for seed in range(40))


def test_a_part_that_stands_out_is_a_change_in_time() -> None:
    (entry,) = found(1, {(1, 1): 9.0}, {})
    assert (entry.variable, entry.on) == ("time", "tau1")
    assert "free_02" in entry.words
    assert entry.share == pytest.approx(8.0 / (8 + 8.0), abs=0.06)


def test_a_whole_trial_is_named() -> None:
    (entry,) = found(2, {(2, 0): 9.0, (2, 1): 9.0}, {})
    assert entry.variable == "one_trial"
    assert "free_03" in entry.words and "free_01" not in entry.words


def test_a_quicker_trial_may_be_noisier() -> None:
    assert not found(3, {(2, 0): 9.0, (2, 1): 9.0}, {2: 3.0})


def test_two_stretches_are_too_few_to_tell() -> None:
    rows = Rows([term("friction.coulomb", "joint1")], trials=1, count=300)
    views = [SimpleNamespace(name="free_01", omega=np.ones((10, 1)))]
    target = rows.target({})
    target[0, 0, :150] *= 5.0
    table = rows.table(target)
    assert not unsteady(replace(table), [], cast(list[View], views))
