"""Are the instantaneous values normally distributed, as linear random-data methods like them?

Source: [P] Sec. IV, which reads a normal probability plot between the probabilities 0.05 and 0.95. Samples at
500 Hz of a signal of a few hertz repeat each other, so the test runs on samples far enough apart to be
independent.
"""

from dataclasses import dataclass

import numpy as np
from scipy import special

from impid_host.impedance.spectral.arrays import Floats
from impid_host.impedance.spectral.stationarity import power_correlation_time_s

FEWEST_SAMPLES = 20


@dataclass(frozen=True, slots=True)
class NormalityCheck:
    """Outcome per signal.

    Attributes:
        names: the signals, n of them.
        largest_deviation: between probabilities 0.05 and 0.95, of the standardised quantile from the normal
            one, in standard deviations, shape (n,).
        tail_deviation: the same at probabilities 0.01 and 0.99, shape (n,).
        independent_samples: how many independent values the record is worth, shape (n,).
        p_value: of D'Agostino and Pearson's test on independent samples, shape (n,); NaN when too few.
        level: false-alarm probability of the whole check (Holm over the signals).
        holds: True when nothing speaks against normality, None when the record is too short to tell.
    """

    names: tuple[str, ...]
    largest_deviation: Floats
    tail_deviation: Floats
    independent_samples: Floats
    p_value: Floats
    level: float
    holds: bool | None

    @property
    def verdict(self) -> str:
        """One sentence for the lab book."""
        if self.holds is None:
            fewest = self.independent_samples.min()
            return f"cannot tell: the record is worth {fewest:.0f} independent values; record longer"
        if self.holds:
            return (
                f"values are normal within {self.largest_deviation.max():.2f} standard deviations between "
                "probabilities 0.05 and 0.95"
            )
        worst = int(np.nanargmin(self.p_value))
        return (
            f"{self.names[worst]} is not normally distributed (p = {self.p_value[worst]:.2g}, quantiles off "
            f"by up to {self.largest_deviation[worst]:.2f} standard deviations): look for saturation, "
            "stops or friction"
        )

    def __str__(self) -> str:
        return f"normality: {self.verdict}"


def normality(signals: Floats, fs: float, names: tuple[str, ...], level: float = 0.05) -> NormalityCheck:
    """Compare each signal's distribution with the normal one. Arguments as for `stationarity`."""
    from scipy.stats import normaltest  # noqa: PLC0415  (half a second)

    inner = np.linspace(0.05, 0.95, 91)
    tails = np.array([0.01, 0.99])
    body, tail, count, p_value = [], [], [], []
    for column in signals.T:
        z = (column - column.mean()) / column.std()
        body.append(np.max(np.abs(np.quantile(z, inner) - special.ndtri(inner))))
        tail.append(np.max(np.abs(np.quantile(z, tails) - special.ndtri(tails))))
        step = max(1, round(power_correlation_time_s(column, fs) * fs))
        independent = z[::step]
        count.append(len(independent))
        p_value.append(normaltest(independent).pvalue if len(independent) >= FEWEST_SAMPLES else np.nan)
    p_values = np.array(p_value, dtype=np.float64)
    holds = None if np.any(np.isnan(p_values)) else bool(np.min(p_values) * len(names) >= level)
    return NormalityCheck(
        names, np.array(body), np.array(tail), np.array(count, dtype=np.float64), p_values, level, holds
    )
