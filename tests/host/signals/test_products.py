"""What is done by products of matrices or by formula, against the plain sums and factorisations of scipy."""

import numpy as np
import pytest
from impid_host.effects.friction import dahl, stop
from impid_host.effects.response import NODES_HZ, filtered
from impid_host.signals.filters import FiniteResponse, ZeroPhaseChebyshev, ZeroPhaseLowPass
from impid_host.signals.quantiles import NORMAL_975, student_975
from impid_host.signals.systems import solved
from scipy import signal, stats


@pytest.mark.parametrize(
    ("count", "taps", "step"), [(400, 13, 1), (400, 61, 5), (401, 121, 10), (13, 13, 1), (5, 9, 1)]
)
def test_a_finite_response_is_its_convolution(count: int, taps: int, step: int) -> None:
    rng = np.random.default_rng(count)
    values, h = rng.normal(size=(count, 3)), rng.normal(size=taps)
    plain = np.stack([np.convolve(column, h) for column in values.T], axis=1)
    response = FiniteResponse.of(h, step)
    inside = plain[taps - 1 : count : step] if count >= taps else plain[:0]
    assert response.apply(values) == pytest.approx(inside, abs=1e-12)
    half = taps // 2
    assert response.apply(values, half) == pytest.approx(plain[half : half + count : step], abs=1e-12)


def test_zero_phase_filters_are_those_of_scipy() -> None:
    values = np.random.default_rng(2).normal(size=(900, 2, 2))
    values[:, 1, 0] = 0.0
    sos = signal.butter(5, 4.5, fs=250.0, output="sos")
    expected = signal.sosfiltfilt(sos, values, axis=0, padlen=int(3 * 250 / 4.5))
    assert ZeroPhaseLowPass(5, 4.5).apply(values, 250.0) == pytest.approx(expected, abs=1e-13)
    sos = signal.cheby1(8, 0.05, 40.0, fs=1000.0, output="sos")
    expected = signal.sosfiltfilt(sos, values, axis=0)
    assert ZeroPhaseChebyshev(8, 0.05, 40.0).apply(values, 1000.0) == pytest.approx(expected, abs=1e-13)


@pytest.mark.parametrize("size", [1, 2, 3])
def test_small_systems(size: int) -> None:
    rng = np.random.default_rng(size)
    A, b = rng.normal(size=(50, size, size)), rng.normal(size=(50, size, 4))
    assert A @ solved(A, b) == pytest.approx(b, abs=1e-9)
    A[7] = 0.0
    with pytest.raises(np.linalg.LinAlgError):
        solved(A, b)


def test_quantiles() -> None:
    assert pytest.approx(stats.norm.ppf(0.975), rel=1e-14) == NORMAL_975
    dof = np.array([1.0, 2.5, 30.0, 1e6])
    assert student_975(dof) == pytest.approx(stats.t.ppf(0.975, dof), rel=1e-12)


def test_bands_are_triangles_in_frequency() -> None:
    dt, count = 0.01, 4001
    values = np.random.default_rng(3).normal(size=count)
    spectrum, frequency = np.fft.rfft(values, 2 * count), np.fft.rfftfreq(2 * count, dt)
    nodes = (0.0, *NODES_HZ, 6.0)
    bands = filtered(values, dt)
    for node in range(1, len(nodes) - 1):
        weight = np.interp(frequency, nodes, np.eye(len(nodes))[node])
        for phase, turn in enumerate((1.0, -1j)):
            expected = np.fft.irfft(spectrum * weight * turn, 2 * count)[:count]
            assert bands[2 * (node - 1) + phase] == pytest.approx(expected, abs=1e-12)


def test_hysteresis_step_by_step() -> None:
    rng = np.random.default_rng(4)
    t = np.arange(3000) * 0.01
    for position in (
        np.sin(t) + 0.3 * np.sin(3.1 * t),
        rng.normal(size=3000).cumsum() * 0.02,
        np.round(np.sin(t), 1),
    ):
        slip, bend = [0.0], [0.0]
        for move in np.diff(position) / 0.3:
            slip.append(min(max(slip[-1] + move, -1.0), 1.0))
            bend.append(np.sign(move) + (bend[-1] - np.sign(move)) * np.exp(-abs(move)))
        assert stop(position, 0.3) == pytest.approx(np.array(slip), abs=1e-12)
        assert dahl(position, 0.3) == pytest.approx(np.array(bend), abs=1e-12)
