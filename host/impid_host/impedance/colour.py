"""The colour of a regression's residual: an autoregression per channel, their innovations correlated.

The autoregression is fitted to expected second moments: what the fitted parameters took away of the
residual is put back through their covariance (the expectation step of restricted likelihood by EM; Laird and
Ware, Biometrics 38, 1982), so that residuals are not mistaken for noise. Whitening is exact from the first
row of each stretch on: row k is predicted from the k rows before it (Levinson and Durbin).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impid_host.signals.arrays import Floats

_TINY = 1e-12
_BLOCK = 4096  # rows at a time
_SILENT = 1e-24  # power of a residual that is none, where targets are about 1
_RIDGE = 1e-9
_SHRINK = 0.98  # of an unstable autoregression's coefficients, repeated until it is stable
_LARGEST_REFLECTION = 0.9999


@dataclass(frozen=True, slots=True)
class Channel:
    """One channel: r_t = sum_j taps[j] r_(t-1-j) + innovation.

    Attributes:
        steps: taps and innovation sd of the predictors of order 0, 1, ... up to the autoregression itself.
        moments: expected lag products that the taps solve, per degree of freedom, (order, order).
        dof: rows behind them, less what the regression's parameters took.
    """

    steps: tuple[tuple[Floats, float], ...]
    moments: Floats
    dof: float

    @property
    def taps(self) -> Floats:
        """Of the autoregression, (order,)."""
        return self.steps[-1][0]

    def run(self, values: Floats) -> Floats:
        """Innovations over their sd of `values` (N, k), one stretch of this channel."""
        taps, sd = self.steps[-1]
        out = values.copy()
        for lag, tap in enumerate(taps, 1):
            out[lag:] -= tap * values[:-lag]
        out /= sd
        for row, (begin, spread) in enumerate(self.steps[: min(len(taps), len(values))]):
            out[row] = (values[row] - begin @ values[:row][::-1]) / spread
        return out

    def neighbours(self) -> Iterator[tuple["Channel", "Channel"]]:
        """Pairs one standard deviation to either side, along independent directions of what was estimated."""
        taps, sd = self.steps[-1]
        step = float(np.exp(1 / np.sqrt(2 * self.dof)))
        yield self._with(taps, sd * step), self._with(taps, sd / step)
        if len(taps):
            # A narrow band makes lag products near-singular: eigenvalues below rounding are none.
            power, axes = np.linalg.eigh(self.moments)
            power = np.maximum(power, _TINY * power[-1] + _SILENT)
            for direction in (sd / np.sqrt(self.dof) * axes / np.sqrt(power)).T:
                yield self._with(taps + direction, sd), self._with(taps - direction, sd)

    def _with(self, taps: Floats, sd: float) -> "Channel":
        return replace(self, steps=_predictors(taps, sd))


@dataclass(frozen=True, slots=True)
class Colour:
    """All c channels, and `mixing` (c, c), which takes the correlation out of their innovations."""

    channels: tuple[Channel, ...]
    mixing: Floats

    @property
    def orders(self) -> tuple[int, ...]:
        """Order of the autoregression per channel."""
        return tuple(len(channel.taps) for channel in self.channels)

    def whitened(self, stretches: Sequence[Floats]) -> list[Floats]:
        """Stretches (N, c, k) through the channels' filters: unit variance, no correlation."""
        return self._mixed(self._alone(stretches))

    def log_weight(self, stretches: Sequence[Floats]) -> float:
        """log of the determinant of `whitened`: what the likelihood of the rows themselves has besides."""
        unmixed = float(np.sum(np.log(np.abs(np.diag(self.mixing)))))
        total = sum(len(part) for part in stretches) * unmixed
        for channel in self.channels:
            for part in stretches:
                first = min(len(channel.taps), len(part))
                total -= sum(float(np.log(sd)) for _, sd in channel.steps[:first])
                total -= (len(part) - first) * float(np.log(channel.steps[-1][1]))
        return total

    def neighbours(self, stretches: Sequence[Floats]) -> Iterator[tuple[list[Floats], list[Floats]]]:
        """What `whitened` gives one standard deviation to either side, along independent directions."""
        alone = self._alone(stretches)
        for c, channel in enumerate(self.channels):
            for pair in channel.neighbours():
                up, down = ([part.copy() for part in alone] for _ in pair)
                for values, raised, lowered in zip(stretches, up, down, strict=True):
                    raised[:, c], lowered[:, c] = (neighbour.run(values[:, c]) for neighbour in pair)
                yield self._mixed(up), self._mixed(down)

    def _alone(self, stretches: Sequence[Floats]) -> list[Floats]:
        return [
            np.stack([channel.run(values[:, c]) for c, channel in enumerate(self.channels)], axis=1)
            for values in stretches
        ]

    def _mixed(self, alone: list[Floats]) -> list[Floats]:
        return alone if len(self.channels) == 1 else [self.mixing @ values for values in alone]


def colour_of(residuals: Sequence[Floats], highest: int) -> Colour:
    """The colour of a residual.

    Args:
        residuals: stretches (N, c, 1 + p): the residual, then design @ root of the parameters' covariance.
        highest: order that the autoregression may have; BIC chooses.
    """
    count = residuals[0].shape[1]
    rows = sum(len(part) for part in residuals)
    highest = max(0, min(highest, rows // 20, max(len(part) for part in residuals) // 4))
    channels = tuple(_channel([part[:, c] for part in residuals], highest) for c in range(count))
    innovations = Colour(channels, np.eye(count)).whitened(residuals)
    correlation = sum(np.einsum("nck,ndk->cd", part, part) for part in innovations) / rows
    correlation = correlation + (_RIDGE * np.trace(correlation) + 1e-300) * np.eye(count)
    size = np.sqrt(np.diag(correlation))
    correlation = correlation / np.outer(size, size)
    return Colour(channels, np.linalg.inv(np.linalg.cholesky(correlation)))


def _channel(parts: Sequence[Floats], highest: int) -> Channel:
    """Least squares on expected lag products, order by BIC over the same rows."""
    S, count = _lag_products(parts, highest)
    scores = [
        count * np.log(_solved(S, order)[1] / count) + order * np.log(count) for order in range(highest + 1)
    ]
    order = int(np.argmin(scores))
    S, count = _lag_products(parts, order)
    taps, power = _solved(S, order)
    own, _ = _lag_products([part[:, :1] for part in parts], order)
    whitener = np.concatenate([[1.0], -taps])
    dof = max(count * float(whitener @ own @ whitener) / power, 1.0)
    return Channel(_predictors(taps, float(np.sqrt(power / count))), S[1:, 1:] / count, dof)


def _predictors(taps: Floats, sd: float) -> tuple[tuple[Floats, float], ...]:
    """Of all orders up to that of `taps`, which are shrunk first where they are unstable."""
    while True:
        found, variance = [(taps, sd)], sd**2
        while len(found[-1][0]) and abs(last := float(found[-1][0][-1])) < _LARGEST_REFLECTION:
            longer = found[-1][0][:-1]
            variance /= 1 - last**2
            found.append(((longer + last * longer[::-1]) / (1 - last**2), float(np.sqrt(variance))))
        if len(found[-1][0]) == 0:
            return tuple(found[::-1])
        taps = taps * _SHRINK


def _solved(S: Floats, order: int) -> tuple[Floats, float]:
    """Taps, and the power of the innovations."""
    own = S[1 : order + 1, 1 : order + 1] + (_TINY * S[0, 0] + _SILENT) * np.eye(order)
    taps = np.linalg.solve(own, S[1 : order + 1, 0]) if order else np.zeros(0)
    return taps, max(float(S[0, 0] - taps @ S[1 : order + 1, 0]), _TINY * float(S[0, 0]) + _SILENT)


def _lag_products(parts: Sequence[Floats], order: int) -> tuple[Floats, int]:
    """Sum of r_(t-i) r_(t-j) over the rows that have `order` rows before them, (order + 1, order + 1)."""
    S = np.zeros((order + 1, order + 1))
    count = 0
    for part in parts:
        for begin in range(order, len(part), _BLOCK):
            end = min(begin + _BLOCK, len(part))
            lagged = np.stack([part[begin - lag : end - lag].ravel() for lag in range(order + 1)])
            S += lagged @ lagged.T
            count += end - begin
    return S, count
