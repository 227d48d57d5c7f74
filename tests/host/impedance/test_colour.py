"""The residual's colour: whitening against closed forms, and intervals where the colour is hard to see."""

import numpy as np
import pytest
from impid_host.impedance.colour import Channel, Colour, colour_of
from impid_host.impedance.linear import Estimate, Stretch, fit_linear
from scipy import signal, stats

NAMES = ("a", "b", "c", "d", "e", "f")


def coloured(rng: np.random.Generator, count: int, pole: float, channels: int = 1) -> np.ndarray:
    white = rng.normal(size=(count + 500, channels))
    return signal.lfilter([1.0], [1.0, -pole], white, axis=0)[500:]


def test_whitening_is_exact_from_the_first_row() -> None:
    # r_t = 1.2 r_(t-1) - 0.5 r_(t-2) + e, var e = 4: its predictors of lower order and its covariance in
    # closed form (Box and Jenkins, ch. 3).
    first, second, sd = 1.2, -0.5, 2.0
    lag_one = first / (1 - second)
    power = sd**2 / (1 - second**2) / (1 - lag_one**2)
    steps = (
        (np.zeros(0), np.sqrt(power)),
        (np.array([lag_one]), np.sqrt(power * (1 - lag_one**2))),
        (np.array([first, second]), sd),
    )
    count = 40
    response = signal.lfilter([1.0], [1.0, -first, -second], np.eye(1, 400)[0])
    lags = sd**2 * np.array([response[: 400 - k] @ response[k:] for k in range(count)])
    covariance = lags[np.abs(np.subtract.outer(np.arange(count), np.arange(count)))]
    W = Channel(steps, np.eye(2), 1.0).run(np.eye(count))
    assert pytest.approx(np.eye(count), abs=1e-9) == W @ covariance @ W.T


def test_colour_of_a_long_record() -> None:
    rng = np.random.default_rng(1)
    white = rng.normal(size=(60_000, 2)) @ np.linalg.cholesky(np.array([[1.0, 0.6], [0.6, 1.0]])).T
    record = np.stack(
        [
            signal.lfilter([3.0], [1.0, -0.9], white[:, 0]),
            signal.lfilter([0.5], [1.0, 0.0, 0.4], white[:, 1]),
        ],
        axis=1,
    )
    colour = colour_of([record[:, :, None]], 8)
    assert colour.channels[0].taps[0] == pytest.approx(0.9, abs=0.02)
    assert colour.channels[1].taps[:2] == pytest.approx([0.0, -0.4], abs=0.02)
    flat = colour.whitened([record[:, :, None]])[0][:, :, 0]
    assert np.cov(flat.T) == pytest.approx(np.eye(2), abs=0.02)
    assert np.abs(np.corrcoef(flat[1:].T, flat[:-1].T)[:2, 2:]).max() < 0.02


def test_an_unstable_fit_is_made_stable() -> None:
    growing = 1.05 ** np.arange(120.0)[:, None, None]
    colour = colour_of([growing], 4)
    assert isinstance(colour, Colour)
    assert np.all(np.isfinite(colour.whitened([growing])[0]))


def short_and_slow(seed: int) -> Estimate:
    """80 rows, six slow columns, noise as slow as they are."""
    rng = np.random.default_rng(seed)
    t = np.arange(80) / 80
    columns = [np.ones(80), t, *(np.sin(np.pi * k * t + k) for k in (1, 2, 3, 4))]
    design = np.stack(columns, axis=1)[:, None, :]
    return fit_linear([Stretch(design, coloured(rng, 80, 0.8))], NAMES, ("",) * 6)


def test_what_fitting_took_from_the_residual_is_put_back() -> None:
    fits = [short_and_slow(seed) for seed in range(300)]
    inside = np.mean([(fit.ci95[:, 0] <= 0) & (fit.ci95[:, 1] >= 0) for fit in fits])
    # A residual taken for noise gives 87 % here.
    assert 0.92 < inside < 0.98


def test_correlated_channels_help_each_other() -> None:
    # Zellner 1962: unrelated regressors, errors correlated by rho: the variance falls to 1 - rho^2.
    rho, errors = 0.9, []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        design = np.zeros((300, 2, 2))
        design[:, 0, 0], design[:, 1, 1] = rng.normal(size=(2, 300))
        noise = rng.normal(size=(300, 2)) @ np.linalg.cholesky(np.array([[1.0, rho], [rho, 1.0]])).T
        fit = fit_linear([Stretch(design, noise)], ("a", "b"), ("", ""))
        assert fit.sd == pytest.approx(np.full(2, np.sqrt((1 - rho**2) / 300)), rel=0.35)
        errors.append(fit.value)
    assert np.mean(np.square(errors)) * 300 == pytest.approx(1 - rho**2, rel=0.3)


def test_degrees_of_freedom_of_white_noise_are_the_textbooks() -> None:
    rng = np.random.default_rng(6)
    design = rng.normal(size=(40, 1, 3))
    target = rng.normal(size=(40, 1))
    fit = fit_linear([Stretch(design, target)], ("a", "b", "c"), ("", "", ""))
    assert fit.ar_order == (0,)
    value, residual, *_ = np.linalg.lstsq(design[:, 0], target[:, 0], rcond=None)
    assert fit.value == pytest.approx(value, rel=1e-6)
    # No narrower than the textbook's t interval, and wider only where the kernel estimate is.
    narrow = stats.t.ppf(0.975, 37) * np.sqrt(
        residual[0] / 37 * np.diag(np.linalg.inv(design[:, 0].T @ design[:, 0]))
    )
    half = 0.5 * np.diff(fit.ci95, axis=1)[:, 0]
    assert np.all((half > 0.99 * narrow) & (half < 1.2 * narrow))
    assert fit.dof == pytest.approx(37, abs=2)
    assert fit.half_width(np.array([[1.0, 0.0, 0.0]]))[0] == pytest.approx(half[0])


def test_noise_that_grows_with_the_motion() -> None:
    inside = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        x = signal.lfilter([1.0], [1.0, -0.7], rng.normal(size=400))
        noise = rng.normal(size=400) * np.abs(x)
        fit = fit_linear([Stretch(x[:, None, None], noise[:, None])], ("k",), ("",))
        inside.append(fit.ci95[0, 0] <= 0 <= fit.ci95[0, 1])
    # Rows of one variance would claim sqrt(3) too little and hold the truth in 74 %.
    assert np.mean(inside) > 0.90
