"""The noise model against processes with known coefficients and scipy's densities."""

import numpy as np
import pytest
from impid_host.diagnosis.noise import (
    TAILS,
    Rich,
    autoregression,
    log_density,
    noise_models,
    tail_of,
    whitened,
)
from impid_host.diagnosis.rows import slots_of
from scipy import stats
from scipy.signal import lfilter

from .synthetic import Rows, term

PHI, SD = np.array([1.2, -0.6]), 0.3


def second_order(seed: int, count: int, stretches: int) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    return [
        lfilter([1.0], [1.0, *-PHI], SD * rng.standard_normal(count + 200))[200:] for _ in range(stretches)
    ]


def test_an_autoregression_of_second_order_is_found() -> None:
    """Yule-Walker's asymptotic covariance: sigma^2 Gamma^-1 / N; for AR(2) var(phi) = (1 - phi2^2) / N."""
    parts = second_order(1, 4000, 4)
    taps = autoregression(parts)
    sd = 1.0 / taps[0]
    se = np.sqrt((1 - PHI[1] ** 2) / 16000)
    assert sd == pytest.approx(SD, rel=4 / np.sqrt(2 * 16000))
    assert -taps[1:3] * sd == pytest.approx(PHI, abs=4 * se)
    assert np.abs(taps[3:] * sd).max(initial=0.0) < 5 * se


def test_what_is_whitened_is_white_with_unit_variance() -> None:
    parts = second_order(2, 4000, 2)
    taps = autoregression(parts)
    white = lfilter(taps, [1.0], parts[0])[len(taps) :]
    assert np.var(white) == pytest.approx(1.0, abs=0.08)
    lags = np.array([white[k:] @ white[:-k] / len(white) for k in range(1, 11)])
    assert np.abs(lags).max() < 4 / np.sqrt(len(white))


def test_white_noise_keeps_its_spectrum() -> None:
    rng = np.random.default_rng(3)
    taps = autoregression([2.0 * rng.standard_normal(5000) for _ in range(3)])
    assert taps[0] == pytest.approx(0.5, rel=0.03)
    gain = np.abs(np.fft.rfft(taps, 256))
    assert gain == pytest.approx(np.full(129, 0.5), rel=0.1)


def test_a_channels_model_is_that_of_what_its_regression_leaves() -> None:
    rows = Rows([term("friction.coulomb", "joint1")], trials=3, count=3000)
    colour = np.stack([second_order(10 + k, 3000, 1)[0] for k in range(3)])[None]
    target = rows.target({"friction.coulomb@joint1": 5.0}, noise=0.0) + colour
    runs = rows.runs(slots_of(rows.terms), target)
    taps = noise_models(runs, [Rich(np.array([0]), (frozenset(run.trial for run in runs),))])
    assert 1.0 / taps["torque", 0][0] == pytest.approx(SD, rel=0.03)
    first = whitened(runs, taps)[0]
    lost = len(taps["torque", 0]) - 1
    assert len(first.target) == 3000 - lost
    assert first.begin_s == pytest.approx(lost * 0.05)


@pytest.mark.parametrize("loaded", [["free_02"], ["free_01", "free_03", "free_04"]])
def test_an_effect_in_some_trials_only_is_no_noise(loaded: list[str]) -> None:
    """White noise of 1; one set of coefficients for all trials would leave 2.3 and more."""
    rows = Rows([term("friction.coulomb", "joint1")], trials=4, count=600)
    target = rows.target({})
    for k in range(4):
        target[:, k] += 5.0 * (f"free_{k + 1:02d}" in loaded) * rows.of(rows.terms[0], 0.0)[:, k, :, 0]
    runs = rows.runs(slots_of(rows.terms), target)
    every = frozenset(run.trial for run in runs)
    ways = [Rich(np.array([0]), way) for way in [(every,), (frozenset(loaded), every - frozenset(loaded))]]
    assert 1.0 / noise_models(runs, ways)["torque", 0][0] == pytest.approx(1.0, rel=0.05)
    assert 1.0 / noise_models(runs, ways[:1])["torque", 0][0] > 2.0


@pytest.mark.parametrize("tail", [3.0, 10.0, 100.0])
@pytest.mark.parametrize("rows", [1, 5, 40])
def test_a_blocks_density_is_scipys_multivariate_t(tail: float, rows: int) -> None:
    x = np.random.default_rng(4).standard_normal((6, rows)) * 1.7
    truth = stats.multivariate_t(loc=np.zeros(rows), shape=np.eye(rows), df=tail).logpdf(x)  # type: ignore[arg-type]
    own = log_density(np.sum(x**2, axis=1), np.full(6, float(rows)), np.full(6, tail))
    assert own == pytest.approx(np.atleast_1d(truth), rel=1e-9)


def test_the_last_of_the_tails_is_gaussian() -> None:
    x = np.random.default_rng(5).standard_normal(40)
    own = log_density(np.array([x @ x]), np.array([40.0]), np.array([TAILS[-1]]))
    assert own[0] == pytest.approx(stats.norm.logpdf(x).sum(), abs=0.1)


@pytest.mark.parametrize("tail", [3.0, 1e4])
def test_the_tail_is_that_by_which_the_blocks_were_drawn(tail: float) -> None:
    rng = np.random.default_rng(6)
    scale = np.sqrt(tail / rng.chisquare(tail, 400))
    squares = np.sum((scale[:, None] * rng.standard_normal((400, 40))) ** 2, axis=1)
    found = tail_of(squares, np.full(400, 40.0))
    assert found == tail if tail < 10 else found >= 100
