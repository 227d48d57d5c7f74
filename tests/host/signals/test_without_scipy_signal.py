"""What is done by LAPACK and a few lines, against SciPy's own."""

import numpy as np
import pytest
from impid_host.signals.correlation import correlation, overlap_sums
from impid_host.signals.density import power_density
from impid_host.signals.filters import Sections, gaussian, windowed_sinc
from impid_host.signals.recursive import butterworth_sections, first_order, recursive, second_order
from impid_host.signals.spline import Spline
from scipy import ndimage, signal
from scipy.interpolate import CubicSpline

RATE = 1000.0


def wander(rows: int, columns: int, seed: int = 3) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(rows, columns)).cumsum(axis=0) + 5.0


@pytest.mark.parametrize("order", [1, 2, 4, 5, 8])
@pytest.mark.parametrize("rows", [1, 2, 3, 4000])
def test_a_low_pass_is_that_of_scipy_from_rest_and_settled(order: int, rows: int) -> None:
    values, sections = wander(rows, 3), butterworth_sections(order, 20.0, RATE)
    sos = signal.butter(order, 20.0, fs=RATE, output="sos")
    size = np.abs(values).max()
    rested = signal.sosfilt(sos, values, axis=0)
    assert recursive(sections, values, settled=False) == pytest.approx(rested, abs=1e-10 * size)
    start = signal.sosfilt_zi(sos)[:, :, None] * values[None, None, 0]
    settled = signal.sosfilt(sos, values, axis=0, zi=start)[0]
    assert recursive(sections, values, settled=True) == pytest.approx(settled, abs=1e-10 * size)


def test_no_columns_are_no_columns() -> None:
    assert recursive(butterworth_sections(2, 20.0, RATE), np.zeros((500, 0)), settled=True).shape == (500, 0)
    assert not Sections(butterworth_sections(2, 20.0, RATE)).forth_and_back(np.zeros((500, 2))).any()


@pytest.mark.parametrize("cutoff_hz", [0.0, 500.0, 700.0])
def test_a_low_pass_beyond_half_the_rate_is_refused(cutoff_hz: float) -> None:
    with pytest.raises(ValueError, match="no low-pass"):
        butterworth_sections(2, cutoff_hz, RATE)


def test_lags_are_those_of_the_bilinear_transform() -> None:
    b, a = signal.bilinear([1.0], [0.03, 1.0], RATE)
    assert first_order(0.5 / (RATE * 0.03)) == pytest.approx([*b, 0.0, *a, 0.0], abs=1e-14)
    b, a = signal.bilinear([144.0], [1.0, 24.0, 144.0], RATE)
    assert second_order(0.5 * 12.0 / RATE, 1.0) == pytest.approx([*b, *a], abs=1e-13)


@pytest.mark.parametrize("rows", [2, 3, 4, 5, 900])
def test_a_spline_is_scipys_inside_and_beyond(rows: int) -> None:
    rng = np.random.default_rng(rows)
    t = np.sort(rng.uniform(0, 1, rows))
    values, at = rng.normal(size=(rows, 2, 2)), rng.uniform(-0.1, 1.1, 300)
    at = np.clip(at, t[0] - 1e-3, t[-1] + 1e-3)
    plain = CubicSpline(t, values, axis=0)(at)
    assert Spline(t, values)(at) == pytest.approx(plain, abs=1e-12 * np.abs(plain).max())


@pytest.mark.parametrize("t", [[0.0], [0.0, 1.0, 1.0], [0.0, 2.0, 1.0]])
def test_a_spline_wants_instants_that_increase(t: list[float]) -> None:
    with pytest.raises(ValueError, match="two instants"):
        Spline(np.array(t), np.zeros((len(t), 1)))


@pytest.mark.parametrize("window", [63, 64])
@pytest.mark.parametrize("rid", [True, False])
def test_a_density_is_welchs(window: int, rid: bool) -> None:
    values = wander(700, 2)
    f, power = signal.welch(values, RATE, nperseg=window, axis=0, detrend="constant" if rid else False)
    frequency, density = power_density(values, RATE, window, rid_of_mean=rid)
    assert frequency == pytest.approx(f)
    assert density == pytest.approx(power, rel=1e-10)


@pytest.mark.parametrize(("first", "second"), [(101, 57), (57, 101), (1, 8), (8, 8)])
def test_sums_over_overlaps_are_those_of_shifted_copies(first: int, second: int) -> None:
    rng = np.random.default_rng(first)
    fast, slow = rng.normal(size=(first, 2)), rng.normal(size=(second, 2))
    products, covered, covering = [], [], []
    for place in range(first + second - 1):
        lag = place - (second - 1)
        rows = np.arange(max(0, lag), min(first, lag + second))
        products.append(np.sum(fast[rows] * slow[rows - lag]))
        covered.append(np.sum(fast[rows, 0]))
        covering.append(np.sum(slow[rows - lag, 0]))
    assert correlation(fast, slow) == pytest.approx(products, abs=1e-12)
    assert overlap_sums(fast[:, 0], second) == pytest.approx(covered, abs=1e-12)
    assert overlap_sums(slow[::-1, 0], first) == pytest.approx(covering, abs=1e-12)


@pytest.mark.parametrize("sd", [0.05, 0.8, 2.0, 8.0, 80.0])
def test_a_gaussian_is_scipys(sd: float) -> None:
    values = wander(300, 2)
    assert gaussian(values, sd) == pytest.approx(ndimage.gaussian_filter1d(values, sd, axis=0), abs=1e-10)


def test_a_windowed_sinc_is_scipys() -> None:
    taps = signal.firwin(61, 4.0, fs=50.0)
    assert windowed_sinc(np.hamming(61), 4.0 / 50.0) == pytest.approx(taps, abs=1e-14)
    taps = signal.firwin(161, 1 / 5, window=("kaiser", 8.0))
    assert windowed_sinc(np.kaiser(161, 8.0), 0.1) == pytest.approx(taps, abs=1e-14)
