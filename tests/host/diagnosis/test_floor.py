"""The noise floor against noise whose size is known in closed form."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from impid_host.diagnosis.case import prepare, saturated, tabulated
from impid_host.diagnosis.floor import FREE, PER_COLUMN, noise_floor, noise_series
from impid_host.diagnosis.refit import refit
from impid_host.diagnosis.result import Floor
from impid_host.study.model import Study
from scipy import signal

from .machines import TAU_NOISE, Case, build

RATE_HZ = 1000.0


def in_band(sd: float, rate_hz: float) -> float:
    """rms of white noise behind a zero-phase Butterworth of fifth order at 4.5 Hz, by its |H|^2."""
    f = np.linspace(0, 0.5 * rate_hz, 400_001)
    warped = np.tan(np.pi * f[:-1] / rate_hz) / np.tan(np.pi * 4.5 / rate_hz)
    return sd * float(np.sqrt(np.mean((1 / (1 + warped**10)) ** 2)))


def floor_of(study: Study) -> Floor:
    case = prepare(study)
    table = tabulated(case)
    seconds = sum(float(view.valid.sum()) * view.dt for view in case.views)
    rich = saturated(case.base, table.slots, round(5 * 2 * 4.5 * seconds / PER_COLUMN))
    return noise_floor(case, refit(case, [], table.noise.taps), rich)


def logged(study: Study, change: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Study:
    """Every torque as `change` of its times and values."""
    trials = tuple(
        replace(trial, robot=replace(trial.robot, tau=change(trial.robot.t, trial.robot.tau)))
        for trial in study.trials
    )
    return replace(study, trials=trials)


def as_it_is(_t: np.ndarray, tau: np.ndarray) -> np.ndarray:
    return tau


def interpolated(t: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """A drive that tells its torque at 100 Hz, a straight line between."""
    return np.stack([np.interp(t, t[::10], own[::10]) for own in tau.T], axis=1)


def quantised(_t: np.ndarray, tau: np.ndarray) -> np.ndarray:
    return np.round(tau / 0.02) * 0.02


@pytest.mark.parametrize(
    ("model", "seconds", "change", "sd", "rate_hz"),
    [
        ("joint-1d", 40.0, as_it_is, TAU_NOISE, RATE_HZ),
        ("planar-2r-relative", 60.0, as_it_is, TAU_NOISE, RATE_HZ),
        ("joint-1d", 40.0, interpolated, TAU_NOISE, 100.0),
        # Steps of twice the noise: what rounding adds is white, a twelfth of their square.
        ("joint-1d", 40.0, quantised, np.hypot(TAU_NOISE, 0.02 / np.sqrt(12)), RATE_HZ),
    ],
)
def test_white_noise_is_found(
    model: str,
    seconds: float,
    change: Callable[[np.ndarray, np.ndarray], np.ndarray],
    sd: float,
    rate_hz: float,
    tmp_path: Path,
) -> None:
    case = Case(model, seed=140, free=1, loaded=0, seconds=seconds, device=False)
    found = floor_of(logged(build(case, tmp_path), change)).saturated
    for value in found.values():
        assert value == pytest.approx(in_band(sd, rate_hz), rel=0.25)
    assert found


@pytest.mark.parametrize(("model", "seconds"), [("joint-1d", 10.0), ("planar-2r-relative", 16.0)])
def test_a_record_too_short_to_tell_has_no_floor(model: str, seconds: float, tmp_path: Path) -> None:
    """Seen before: a quarter of the noise at 16 s, and a traceback at 10 s."""
    told = floor_of(build(Case(model, seed=141, free=1, loaded=0, seconds=seconds, device=False), tmp_path))
    assert not told.saturated
    assert told.value("tau1") is None
    assert told.origin("tau1") == "none"


def stretch(count: int, columns: int, sd: float, taps: tuple[float, ...] = (1.0,)) -> np.ndarray:
    """[target | columns]: noise of known rms on top of what the columns span."""
    rng = np.random.default_rng([9, count, columns])
    noise = signal.lfilter([1.0], taps, rng.standard_normal(count + 100))[100:]
    X = rng.standard_normal((count, columns))
    return np.column_stack([X @ rng.standard_normal(columns) + sd * noise / np.std(noise), X])


@pytest.mark.parametrize("taps", [(1.0,), (1.0, -0.8)])
@pytest.mark.parametrize("columns", [5, 60, 140])
def test_what_the_columns_take_of_the_noise_is_given_back(columns: int, taps: tuple[float, ...]) -> None:
    rows = stretch(300, columns, 0.3, taps)
    (noise,) = noise_series([rows], np.arange(300) >= 200)
    assert np.std(noise[200:]) == pytest.approx(0.3, rel=0.3)


def test_columns_that_leave_too_little_tell_nothing() -> None:
    held = np.arange(90) >= 60
    # A third of the rows is held out, and so is about a third of what is left: 60 of 90 rows, 20 of 30.
    assert np.isfinite(noise_series([stretch(90, 90 - 3 * FREE - 12, 0.3)], held)[0]).all()
    assert np.isnan(noise_series([stretch(90, 60, 0.3)], held)[0]).all()
    assert np.isnan(noise_series([stretch(90, 89, 0.3)], held)[0]).all()
    assert np.isnan(noise_series([stretch(90, 5, 0.3)], np.zeros(90, dtype=bool))[0]).all()
    # Enough is left of a long record, but the columns took more.
    assert np.isnan(noise_series([stretch(300, 200, 0.3)], np.arange(300) >= 200)[0]).all()


def test_a_joint_without_a_drive_has_no_noise() -> None:
    rows = stretch(90, 5, 0.3)
    rows[:, 0] = 0.0
    assert not noise_series([rows], np.arange(90) >= 60)[0].any()
