"""Force read in one instant, against the exact response of two masses, spring and damper to a held force."""

from functools import cache
from typing import Literal

import numpy as np
import pytest
from impid_host.checks.force_instant import force_instants
from impid_host.signals.force_timing import as_means, first_of_reading, following
from impid_host.study.model import ForceSensor, RobotLog, RobotSetup, Setup, Study, Trial
from scipy.linalg import expm
from scipy.signal import butter, sosfilt

ROBOT_KG, M, B, K = 1.3, 1.45, 10.9, 172.0
PERIOD_S, FINE = 2e-3, 20
INSTANT = ForceSensor(timing="instant")


@cache
def shaken(seed: int = 1, rows: int = 4000, noise_N: float = 0.01) -> dict[str, np.ndarray]:
    """Force of the load on a robot that is pushed by a staircase: per row the mean, after, before, (N, 2)."""
    rng = np.random.default_rng(seed)
    p = sosfilt(butter(4, 15.0, fs=1 / PERIOD_S, output="sos"), 20 * rng.standard_normal((rows, 2)), axis=0)
    total = ROBOT_KG + M
    dynamics = np.array([[0.0, 1.0, 0.0], [-K / total, -B / total, 1 / total], [0.0, 0.0, 0.0]])
    step = expm(dynamics * PERIOD_S / FINE)
    state = np.zeros((3, 2))
    fine = np.zeros((rows, FINE + 1, 2))
    for k in range(rows):
        state[2] = p[k]
        for j in range(FINE + 1):
            acceleration = (state[2] - B * state[1] - K * state[0]) / total
            fine[k, j] = -(M * acceleration + B * state[1] + K * state[0])
            if j < FINE:
                state = step @ state
    half = FINE // 2
    trapezoid = np.full(half + 1, 1.0 / half)
    trapezoid[[0, -1]] *= 0.5
    behind = np.einsum("j,kjd->kd", trapezoid, fine[:, half:])
    ahead = np.einsum("j,kjd->kd", trapezoid, fine[:, : half + 1])
    mean = 0.5 * (ahead + np.concatenate([np.zeros((1, 2)), behind[:-1]]))
    before = np.concatenate([np.zeros((1, 2)), fine[:-1, -1]])
    add = noise_N * rng.standard_normal((rows, 2))
    return {"p": p, "mean": mean + add, "after": fine[:, 0] + add, "before": before + add, "noise": add}


def log_of(force: np.ndarray, p: np.ndarray | None = None) -> RobotLog:
    t = PERIOD_S * np.arange(float(len(force)))
    zeros = np.zeros((len(force), 2))
    return RobotLog(t=t, theta=zeros, tau=zeros, force=force, perturbation=p)


@pytest.mark.parametrize("how", ["after", "before"])
def test_an_instant_beside_a_step_becomes_the_mean(how: str) -> None:
    parts = shaken()
    before = np.std(parts[how] - parts["mean"])
    corrected = as_means(log_of(parts[how], parts["p"]), INSTANT).force
    assert corrected is not None
    assert before > 0.1
    assert np.std((corrected - parts["mean"])[10:-10]) < 0.02 * before


def test_how_late_a_step_comes_is_found() -> None:
    parts = shaken(seed=1)
    t = PERIOD_S * np.arange(float(len(parts["p"])))
    for how, rows in (("after", 0.0), ("mean", 0.5), ("before", 1.0)):
        found = following(parts[how], parts["p"], t)
        assert found is not None
        assert found.steps == pytest.approx(rows, abs=0.05)
        assert found.share == pytest.approx(-M / (M + ROBOT_KG) * np.eye(2), abs=0.02)


def test_a_mean_stays_as_it_is() -> None:
    parts = shaken()
    log = log_of(parts["mean"], parts["p"])
    assert as_means(log, ForceSensor()) is log


def test_a_held_reading_is_that_of_its_first_row() -> None:
    t = PERIOD_S * np.arange(4000)
    smooth = np.stack([np.sin(2 * np.pi * t), np.cos(3 * np.pi * t)], axis=1)
    held = smooth[(np.arange(4000) // 4) * 4]
    assert first_of_reading(held)[:9].tolist() == [True, False, False, False] * 2 + [True]
    restored = as_means(log_of(held), INSTANT).force
    assert restored is not None
    assert np.abs(restored - smooth)[:-4].max() < 1e-5
    assert np.abs(held - smooth).max() > 0.03


def test_readings_that_chance_to_be_equal_are_not_held() -> None:
    coarse = np.round(shaken()["mean"], 1)
    assert first_of_reading(coarse).all()


@pytest.mark.parametrize(
    ("how", "timing", "said"),
    [
        ("mean", "mean", None),
        ("after", "mean", '"instant"'),
        ("before", "mean", '"instant"'),
        ("after", "instant", None),
        ("before", "instant", None),
        ("mean", "instant", '"mean"'),
    ],
)
def test_the_check_says_which_timing(how: str, timing: Literal["mean", "instant"], said: str | None) -> None:
    parts = shaken(seed=1)
    trial = Trial("arm_01", "stochastic", "arm", log_of(parts[how], parts["p"]), on="arm")
    setup = Setup(RobotSetup("planar-2r-absolute", (0.3, 0.3)), force_sensor=ForceSensor(timing=timing))
    found = list(force_instants(Study("s", setup, (trial,))))
    assert [one.what for one in found] == ([] if said is None else ["methods.disagree"])
    assert said is None or (said in found[0].remedy and found[0].verdict == "suspect")


def test_the_check_sees_held_readings() -> None:
    force = shaken()["mean"]
    held = force[(np.arange(len(force)) // 2) * 2]
    trial = Trial("spring_01", "mass-spring", "spring", log_of(held))
    found = list(force_instants(Study("s", Setup(RobotSetup("planar-2r-absolute", (0.3, 0.3))), (trial,))))
    assert "2 rows" in found[0].words
    assert '"instant"' in found[0].remedy
