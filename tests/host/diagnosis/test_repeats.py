"""Noise by repetition: white noise of known rms on motions that are, or are not, the same twice."""

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from impid_host.diagnosis.repeats import Repeat, repeats
from impid_host.diagnosis.rows import Run
from impid_host.effects.view import View

STEP_S, SD = 0.05, 0.2
BASE = np.array([3.0])


def angle(t: np.ndarray) -> np.ndarray:
    return np.sin(2 * np.pi * 0.3 * t) + 0.5 * np.sin(2 * np.pi * 0.7 * t + 1.0)


def once(t: np.ndarray) -> np.ndarray:
    """Quicker and quicker: never the same again."""
    return np.sin(2 * np.pi * (0.1 + 0.01 * t) * t)


def recorded(
    theta: np.ndarray, name: str = "free_01", load: str | None = None, seed: int = 0
) -> tuple[View, Run]:
    """A trial whose torque is 3 theta, what no model has, and noise."""
    t = STEP_S * np.arange(len(theta))
    view = SimpleNamespace(name=name, load=load, theta=theta[:, None], dt=STEP_S, t=t)
    noise = SD * np.random.default_rng([3, seed]).standard_normal(len(t))
    nothing = np.zeros((len(t), 0), dtype=np.float32)
    target = 3.0 * theta + 0.8 * theta**2 + noise
    own = (target, theta[:, None], np.zeros(0, dtype=np.intp), nothing)
    run = Run(name, "torque", 0, "fit", 0.0, STEP_S, *own)
    return cast(View, view), run


def found(*trials: tuple[View, Run]) -> list[Repeat]:
    return repeats([run for _, run in trials], [view for view, _ in trials], BASE)


def test_a_motion_repeated_in_a_trial_shows_its_noise_whatever_the_model_lacks() -> None:
    one = angle(STEP_S * np.arange(400))
    (repeat,) = found(recorded(np.tile(one, 2)))
    noise = repeat.by_family["torque"]
    assert len(noise) == 400
    assert np.sqrt(np.mean(noise**2)) == pytest.approx(SD, rel=4 / np.sqrt(2 * 400))


def test_a_motion_repeated_in_another_trial_and_begun_later() -> None:
    t = STEP_S * np.arange(600)
    pair = recorded(once(t)), recorded(once(t + 3.0), "free_02", seed=1)
    (repeat,) = found(*pair)
    noise = repeat.by_family["torque"]
    assert np.sqrt(np.mean(noise**2)) == pytest.approx(SD, rel=4 / np.sqrt(2 * len(noise)))
    assert len(noise) == 600 - 60


def test_another_load_and_another_motion_are_no_repetition() -> None:
    t = STEP_S * np.arange(400)
    assert not found(recorded(once(t)))
    assert not found(recorded(once(t)), recorded(once(t), "spring_01", "spring", seed=1))
    assert not found(recorded(once(t)), recorded(1.05 * once(t), "free_02", seed=1))


def test_what_is_shorter_than_five_seconds_says_nothing() -> None:
    short = angle(STEP_S * np.arange(90))
    assert not found(recorded(short), recorded(short, "free_02", seed=1))
