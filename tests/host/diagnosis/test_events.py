"""Pushes on innovations of known power."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from impid_host.diagnosis.events import Event, events
from impid_host.diagnosis.rows import Run
from impid_host.effects.view import View

STEP = 0.05


def study(seed: int, power, speed=np.ones_like) -> tuple[list[Run], list[np.ndarray], list[View]]:
    """Two trials of 40 s; `power` of the innovations at each instant of the first one."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 40.0, STEP)
    runs, left = [], []
    for trial, level in (("free_01", power(t)), ("free_02", np.ones_like(t))):
        for channel in (0, 1):
            none, free = np.zeros((len(t), 0)), np.zeros((len(t), 0), dtype=np.float32)
            run = Run(
                trial,
                "torque",
                channel,
                "fit",
                0.0,
                STEP,
                t,
                none,
                np.zeros(0, dtype=np.intp),
                free,
            )
            runs.append(run)
            left.append(rng.standard_normal(len(t)) * np.sqrt(level))
    views = [
        SimpleNamespace(name=name, t=t, omega=np.sqrt(speed(t))[:, None] * [1.0, 1.0])
        for name in ("free_01", "free_02")
    ]
    return runs, left, cast(list[View], views)


def test_even_noise_has_no_event() -> None:
    assert not any(events(*study(seed, np.ones_like)) for seed in range(30))


def test_a_push_is_a_stretch_with_its_beginning_and_end() -> None:
    (found,) = events(*study(1, lambda t: np.where((t >= 10.0) & (t < 14.0), 20.0, 1.0)))
    assert (found.trial, found.begin_s, found.end_s) == ("free_01", 10.0, 14.0)
    assert found.ratio == pytest.approx(20.0, rel=0.5)
    assert found.words == "free_01 from 10 to 14 s is unlike the rest"


def test_two_pushes_are_two_events() -> None:
    found = events(*study(2, lambda t: np.where((np.abs(t - 11) < 1) | (np.abs(t - 31) < 1), 20.0, 1.0)))
    assert [(e.begin_s, e.end_s) for e in found] == [(10.0, 12.0), (30.0, 32.0)]


def test_noise_that_comes_and_goes_is_no_event() -> None:
    assert not events(*study(3, lambda t: np.where(np.floor(t / 4) % 2 == 1, 30.0, 1.0)))


def test_a_quick_stretch_may_be_noisier() -> None:
    quick = lambda t: np.where((t >= 10.0) & (t < 14.0), 20.0, 1.0)  # noqa: E731
    assert events(*study(4, quick))
    assert not events(*study(4, quick, speed=quick))


def test_an_accelerometer_alone_is_not_asked() -> None:
    runs, left, views = study(5, lambda t: np.where(t < 2.0, 50.0, 1.0))
    assert not events([replace(run, family="specific_force") for run in runs], left, views)
    assert isinstance(events(runs, left, views)[0], Event)
