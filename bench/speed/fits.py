"""Fitting and diagnosing: ours, and what fifteen lines of scipy do without intervals."""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import impid_host
import numpy as np
from robot_sync import draw
from scipy import signal

from hil_sim.scenarios.random import Size, random_scenario
from hil_sim.study.write import write_study

SEED = 31
CUTOFF_HZ = 4.5
ONE = (1, 0, 0, 50.0)


def study(
    free: int, loads: int, per_load: int, seconds: float, effects: tuple[str, ...] = ()
) -> "impid_host.Study":
    """Of a random laboratory: so many free trials, loads, trials of each load, seconds of each trial."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "study"
        scenario, _ = random_scenario(SEED, Size(free, loads, per_load, seconds), tuple(effects), 4.0)
        write_study(scenario, path, SEED)
        return impid_host.read_study(path)


def fit(*size: float) -> Iterator[int]:
    """`fit`; yields the samples."""
    whole = study(*size)  # type: ignore[arg-type]
    yield sum(len(trial.robot) for trial in whole.trials)
    whole.fit()


def diagnose(*size: float) -> Iterator[int]:
    """`diagnose`."""
    whole = study(*size)  # type: ignore[arg-type]
    yield sum(len(trial.robot) for trial in whole.trials)
    whole.diagnose()


def diagnose_hidden(effects: list[str]) -> Iterator[int]:
    """`diagnose` of 4 trials of 30 s with so many effects hidden."""
    whole = study(2, 1, 2, 30.0, tuple(effects))
    yield len(effects)
    whole.diagnose()


def scipy_alone() -> Iterator[int]:
    """One free trial: zero-phase low-pass, central differences, the first paper's regressor, least squares.

    No clock matching, no accelerometer, no intervals, nothing held out.
    """
    log = study(*ONE).trials[0].robot
    yield len(log)
    rate = 1 / float(np.median(np.diff(log.t)))
    low = signal.butter(5, CUTOFF_HZ, fs=rate, output="sos")
    theta, tau = (signal.sosfiltfilt(low, values, axis=0) for values in (log.theta, log.tau))
    omega = np.gradient(theta, 1 / rate, axis=0)
    acc = np.gradient(omega, 1 / rate, axis=0)
    sine, cosine = (f(theta[:, 0] - theta[:, 1]) for f in (np.sin, np.cos))
    zero = np.zeros(len(theta))
    first = [acc[:, 0], 0.5 * (cosine * omega[:, 1] ** 2 - sine * acc[:, 1]), zero, omega[:, 0], zero]
    second = [zero, 0.5 * (-sine * acc[:, 0] - cosine * omega[:, 0] ** 2), acc[:, 1], zero, omega[:, 1]]
    design = np.concatenate([np.stack(first, axis=1), np.stack(second, axis=1)])
    alpha = np.linalg.lstsq(design, np.concatenate([tau[:, 0], tau[:, 1]]), rcond=None)[0]
    assert alpha[0] > 0.0


def match(draws: int) -> Iterator[int]:
    """Clocks of so many trials of 50 s matched by their angles (robot_sync.py)."""
    yield draws
    for seed in range(draws):
        draw(seed)
