"""Does the record keep its power from beginning to end?

Source: [P] Sec. IV and Bendat & Piersol, Random Data, ch. 4 and 10: mean squares over equal intervals, tested
for trend by reverse arrangements. The count of reverse arrangements is Kendall's tau between value and time.
"""

from dataclasses import dataclass

import numpy as np

from impid_host.impedance.spectral.arrays import Floats

MOST_INTERVALS = 20
FEWEST_INTERVALS = 8
# An interval this many correlation times long leaves neighbouring mean squares practically unrelated.
CORRELATION_TIMES_PER_INTERVAL = 4.0


@dataclass(frozen=True, slots=True)
class StationarityCheck:
    """Outcome of the test for trend, per signal.

    Attributes:
        names: the signals, n of them.
        mean_square: over equal intervals, mean of the record removed, shape (intervals, n), unit squared.
        reverse_arrangements: pairs of intervals whose mean square falls with time, shape (n,).
        p_value: two-sided, exact, shape (n,); NaN when there are too few intervals.
        level: false-alarm probability of the whole check (Holm over the signals).
        holds: True when no trend shows, None when the record is too short to tell.
    """

    names: tuple[str, ...]
    mean_square: Floats
    reverse_arrangements: Floats
    p_value: Floats
    level: float
    holds: bool | None

    @property
    def verdict(self) -> str:
        """One sentence for the lab book."""
        if self.holds is None:
            return (
                "cannot tell: the signals swing so slowly that the record holds only "
                f"{len(self.mean_square)} independent intervals, {FEWEST_INTERVALS} are needed; record longer"
            )
        if self.holds:
            count = len(self.mean_square)
            return f"no trend in power over {count} intervals; averaging over the record is justified"
        worst = int(np.nanargmin(self.p_value))
        x = self.mean_square[:, worst]
        third = max(1, len(x) // 3)
        change = float(np.sqrt(x[-third:].mean() / x[:third].mean()))
        return (
            f"{self.names[worst]} is not stationary (p = {self.p_value[worst]:.2g}): its rms changes by a "
            f"factor {change:.2f} from the first third to the last; the subject may have tensed up or "
            "relaxed, repeat the trial"
        )

    def __str__(self) -> str:
        return f"stationarity: {self.verdict}"


def reverse_arrangements(x: Floats) -> tuple[int, float]:
    """Pairs i < j with x_i > x_j, and the two-sided p-value for an exchangeable sequence x, shape (k,)."""
    from scipy.stats import kendalltau  # noqa: PLC0415  (half a second)

    falls = int(np.sum(np.triu(x[:, np.newaxis] > x[np.newaxis, :], 1)))
    p_value = float(kendalltau(np.arange(len(x)), x, method="auto").pvalue)
    return falls, p_value


def power_correlation_time_s(x: Floats, fs: float) -> float:
    """Time over which the instantaneous power of a Gaussian signal x, shape (N,), stays correlated (s).

    Integral of the squared autocorrelation, both sides; the variance of a mean square over T is
    2 sigma^4 tau / T.
    """
    centred = x - x.mean()
    n_fft = 2 * len(x)
    power = np.abs(np.fft.rfft(centred, n_fft)) ** 2
    autocorrelation = np.fft.irfft(power)[: len(x)] / len(x)
    if autocorrelation[0] <= 0:
        return 1.0 / fs
    rho = autocorrelation / autocorrelation[0]
    # Far lags hold noise only, whose squares add up to 2 lags / N of the result (Bartlett's variance of rho).
    lags = max(2, len(x) // 10)
    return float((1.0 + 2.0 * np.sum(rho[1:lags] ** 2)) / (1.0 + 2.0 * lags / len(x)) / fs)


def stationarity(
    signals: Floats, fs: float, names: tuple[str, ...], level: float = 0.05
) -> StationarityCheck:
    """Test each signal for a trend of its mean square.

    Args:
        signals: shape (N, n), any unit.
        fs: sampling rate, Hz.
        names: of the signals, for the verdict.
        level: probability of a false alarm when all signals are stationary.
    """
    duration = len(signals) / fs
    slowest = max(power_correlation_time_s(column, fs) for column in signals.T)
    intervals = min(MOST_INTERVALS, int(duration / (CORRELATION_TIMES_PER_INTERVAL * slowest)))
    enough = intervals >= FEWEST_INTERVALS
    intervals = max(intervals, 2)
    per_interval = len(signals) // intervals
    centred = signals - signals.mean(axis=0)
    parts = centred[: per_interval * intervals].reshape(intervals, per_interval, -1)
    mean_square = np.mean(parts**2, axis=1)
    tests = [reverse_arrangements(column) for column in mean_square.T]
    falls = np.array([count for count, _ in tests], dtype=np.float64)
    p_value = np.array([p if enough else np.nan for _, p in tests])
    # The smallest of n p-values decides, Holm's first step.
    holds = bool(np.min(p_value) * len(names) >= level) if enough else None
    return StationarityCheck(names, mean_square, falls, p_value, level, holds)
