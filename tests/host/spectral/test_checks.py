import numpy as np
import pytest
import scipy.signal
from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.normality import normality
from impid_host.impedance.spectral.repeatability import repeatability
from impid_host.impedance.spectral.stationarity import (
    power_correlation_time_s,
    reverse_arrangements,
    stationarity,
)
from scipy.stats import norm


def test_reverse_arrangements_of_the_textbook_example():
    # Bendat & Piersol, Random Data, example 4.5: twenty observations with 86 reverse arrangements
    x = np.array(
        [5.2, 6.2, 3.7, 6.4, 3.9, 4.0, 3.9, 5.3, 4.0, 4.6, 5.9, 6.5, 4.3, 5.7, 3.1, 5.6, 5.2, 3.9, 6.2, 5.0]
    )
    assert reverse_arrangements(x)[0] == 86


@pytest.mark.parametrize(("count", "low", "high"), [(10, 11, 33), (20, 64, 125), (30, 162, 272)])
def test_p_value_agrees_with_the_textbook_table(count, low, high):
    """Bendat & Piersol, table A.6: 95 % of stationary sequences have low < A <= high."""

    def sequence_with(arrangements):
        order, left = [], arrangements
        pool = list(range(count))
        while pool:
            k = min(left, len(pool) - 1)
            order.append(pool.pop(k))
            left -= k
        return np.array(order, dtype=float)

    assert reverse_arrangements(sequence_with(low))[0] == low
    assert reverse_arrangements(sequence_with(low))[1] < 0.055
    assert reverse_arrangements(sequence_with(low + 3))[1] > 0.045
    assert reverse_arrangements(sequence_with(high + 1))[1] < 0.055
    assert reverse_arrangements(sequence_with(high - 3))[1] > 0.045


def test_stationary_noise_raises_no_more_alarms_than_stated(truth):
    rng = np.random.default_rng(1)
    alarms = [
        not stationarity(truth.coloured(rng, 10000, 2, cutoff_Hz=4.0), truth.FS, ("a", "b")).holds
        for _ in range(200)
    ]
    assert np.mean(alarms) < 0.10


def test_a_subject_who_tenses_up_is_noticed(truth):
    rng = np.random.default_rng(2)
    x = truth.coloured(rng, 25000, 2, cutoff_Hz=4.0)
    x[:, 1] *= np.linspace(1.0, 1.6, 25000)
    check = stationarity(x, truth.FS, ("F_x", "F_y"))
    assert check.holds is False
    assert "F_y is not stationary" in check.verdict
    assert "factor 1." in check.verdict


def test_a_record_of_slow_swings_is_too_short_to_tell(truth):
    x = truth.coloured(np.random.default_rng(3), 5000, 1, cutoff_Hz=0.3)
    check = stationarity(x, truth.FS, ("d",))
    assert check.holds is None
    assert "cannot tell" in str(check)


def test_power_correlation_time_of_a_first_order_process(truth):
    # autocorrelation exp(-|t|/T): the integral of its square is T
    T = 0.1
    a = np.exp(-1 / (T * truth.FS))
    x = scipy.signal.lfilter([1.0], [1.0, -a], np.random.default_rng(4).standard_normal(400_000))
    assert power_correlation_time_s(x, truth.FS) == pytest.approx(T, rel=0.1)


def test_normal_noise_passes_and_clipped_noise_does_not(truth):
    rng = np.random.default_rng(5)
    x = truth.coloured(rng, 25000, 2)
    assert normality(x, truth.FS, ("F_x", "F_y")).holds is True
    clipped = np.clip(x, -2.0, 2.0)
    check = normality(clipped, truth.FS, ("F_x", "F_y"))
    assert check.holds is False
    assert "saturation" in check.verdict


def test_normality_raises_no_more_alarms_than_stated(truth):
    rng = np.random.default_rng(6)
    alarms = [
        not normality(truth.coloured(rng, 10000, 2, cutoff_Hz=4.0), truth.FS, ("a", "b")).holds
        for _ in range(200)
    ]
    assert np.mean(alarms) < 0.10


def test_uniform_values_deviate_by_the_closed_form():
    """A uniform variable of unit variance has the quantile sqrt(12) (p - 1/2)."""
    x = np.random.default_rng(7).uniform(size=(200_000, 1))
    check = normality(x, 500.0, ("u",))
    p = np.linspace(0.05, 0.95, 91)
    assert check.largest_deviation[0] == pytest.approx(
        np.max(np.abs(np.sqrt(12) * (p - 0.5) - norm.ppf(p))), abs=0.01
    )
    assert check.tail_deviation[0] == pytest.approx(norm.ppf(0.99) - np.sqrt(12) * 0.49, abs=0.02)


def test_repeatability_is_the_squared_correlation_between_trials():
    rng = np.random.default_rng(8)
    common = rng.standard_normal((100_000, 1))
    trials = tuple(common + 0.2 * rng.standard_normal((100_000, 1)) for _ in range(3))
    check = repeatability(trials, ("F_x",))
    assert check.r_squared == pytest.approx(np.full((3, 1), (1 / 1.04) ** 2), abs=0.005)
    assert check.holds is True
    other = (*trials[:2], rng.standard_normal((90_000, 1)))
    check = repeatability(other, ("F_x",))
    assert check.holds is False
    assert "3" in check.verdict
    with pytest.raises(UndeterminedError, match="at least two"):
        repeatability(trials[:1], ("F_x",))
