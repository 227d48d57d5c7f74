"""Estimates and their intervals by Monte Carlo against known truth."""

import numpy as np
import pytest
from impid_host.errors import UndeterminedError
from impid_host.impedance.linear import Estimate, Stretch, fit_linear
from impid_host.impedance.rows import finish
from impid_host.signals.chain import DEFAULT
from scipy import signal

TRUE = np.array([0.8, -12.0, 300.0])
RATE = 250.0
NAMES, UNITS = ("m", "b", "k"), ("kg", "N*s/m", "N/m")


def motion(rng: np.random.Generator, count: int, rate: float) -> np.ndarray:
    """Acceleration, velocity, position of two axes moving in 0 to 2 Hz, (N, 2, 3)."""
    t = np.arange(count) / rate
    angular = 2 * np.pi * rng.uniform(0.1, 2.0, (2, 10, 1))
    phase = rng.uniform(0, 2 * np.pi, (2, 10, 1))
    x = 0.005 * np.sin(angular * t + phase).sum(axis=1)
    v = 0.005 * (angular * np.cos(angular * t + phase)).sum(axis=1)
    a = -0.005 * (angular**2 * np.sin(angular * t + phase)).sum(axis=1)
    return np.stack([a, v, x], axis=2).transpose(1, 0, 2)


def coloured(rng: np.random.Generator, count: int, kind: str) -> np.ndarray:
    """Noise of two channels, (N, 2), correlated between channels."""
    white = rng.normal(0, 1, (count + 4000, 2)) @ np.array([[1.0, 0.4], [0.0, 0.8]])
    if kind == "white":
        return white[4000:]
    pole = np.exp(-2 * np.pi * {"slow": 0.3, "medium": 1.5}[kind] / RATE)
    return signal.lfilter([1.0], [1.0, -pole], white, axis=0)[4000:]


def studies(kind: str, ar_order: int, count: int) -> list[Estimate]:
    """Trials of 30 s at 250 Hz through the default chain's low-pass and decimation, as `fit` does it."""
    estimates = []
    step, count_of_rows = DEFAULT.decimation(RATE), int(30 * RATE)
    for seed in range(count):
        rng = np.random.default_rng(seed)
        stretches = []
        for _ in range(2):
            design = motion(rng, count_of_rows, RATE)
            target = finish(DEFAULT, design @ TRUE + coloured(rng, count_of_rows, kind), RATE)
            rows = slice(250, -250, step)
            stretches.append(Stretch(finish(DEFAULT, design, RATE)[rows], target[rows]))
        estimates.append(fit_linear(stretches, NAMES, UNITS, ar_order=ar_order))
    return estimates


def coverage(estimates: list[Estimate]) -> float:
    return float(np.mean([(e.ci95[:, 0] <= TRUE) & (e.ci95[:, 1] >= TRUE) for e in estimates]))


@pytest.mark.parametrize("kind", ["white", "medium", "slow"])
def test_95_percent_intervals_cover_under_coloured_noise(kind: str) -> None:
    # 100 studies of three parameters: the standard error of a true 95 % is 1.3 %.
    assert 0.91 <= coverage(studies(kind, 8, 100)) <= 0.985


def test_prewhitening_pays_under_slow_noise() -> None:
    plain, white = studies("slow", 0, 50), studies("slow", 8, 50)

    def spread(estimates: list[Estimate]) -> np.ndarray:
        return np.sqrt(np.mean([(e.value - TRUE) ** 2 for e in estimates], axis=0))

    assert spread(white)[2] < 0.9 * spread(plain)[2]
    assert coverage(plain) >= 0.88


def test_exact_data_give_exact_parameters_across_a_cut() -> None:
    rng = np.random.default_rng(0)
    design = motion(rng, 400, 10.0)
    parts = [Stretch(design[:150], design[:150] @ TRUE), Stretch(design[170:], design[170:] @ TRUE)]
    estimate = fit_linear(parts, NAMES, UNITS, ar_order=0)
    assert estimate.value == pytest.approx(TRUE, rel=1e-10)
    assert estimate["k"] == pytest.approx(300.0)


def test_uncertainty_of_earlier_parameters_is_propagated() -> None:
    # target = design b - nuisance g: with nuisance = design's last column, sd(k) grows by exactly sd(g).
    rng = np.random.default_rng(3)
    design = motion(rng, 600, 10.0)
    target = design @ TRUE + rng.normal(0, 0.1, (600, 2))
    bare = fit_linear([Stretch(design, target)], NAMES, UNITS, ar_order=0)
    loaded = fit_linear(
        [Stretch(design, target, design[:, :, 2:])],
        NAMES,
        UNITS,
        ar_order=0,
        nuisance_covariance=np.array([[25.0]]),
    )
    assert loaded.covariance - bare.covariance == pytest.approx(np.diag([0, 0, 25.0]), abs=1e-6)


def test_what_the_rows_do_not_determine_is_named() -> None:
    rng = np.random.default_rng(4)
    design = motion(rng, 400, 10.0)
    tied = design.copy()
    tied[:, :, 1] = 3 * design[:, :, 2]
    with pytest.raises(UndeterminedError, match=r"b.*k"):
        fit_linear([Stretch(tied, design @ TRUE)], NAMES, UNITS)
    flat = design.copy()
    flat[:, :, 1] = 0
    with pytest.raises(UndeterminedError, match="depends on b"):
        fit_linear([Stretch(flat, design @ TRUE)], NAMES, UNITS)
    with pytest.raises(UndeterminedError, match="longer trials"):
        fit_linear([Stretch(design[:4], design[:4] @ TRUE)], NAMES, UNITS)


@pytest.mark.parametrize("silent", [(0,), (0, 1)])
def test_a_channel_without_a_force(silent: tuple[int, ...]) -> None:
    # A torque that was never logged is a column of zeros; it must not take the other with it.
    rng = np.random.default_rng(9)
    design = motion(rng, 400, 10.0)
    target = design @ TRUE + rng.normal(0, 0.01, (400, 2))
    for channel in silent:
        design[:, channel] = 0.0
        target[:, channel] = 0.0
    if len(silent) == 2:
        with pytest.raises(UndeterminedError, match="nothing in these trials"):
            fit_linear([Stretch(design, target)], NAMES, UNITS)
        fit = fit_linear([Stretch(motion(rng, 400, 10.0), target)], NAMES, UNITS)
        assert fit.value == pytest.approx(np.zeros(3))
    else:
        fit = fit_linear([Stretch(design, target)], NAMES, UNITS)
        assert fit.value == pytest.approx(TRUE, rel=0.05)
    assert np.all(np.isfinite(fit.ci95))
