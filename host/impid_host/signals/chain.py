"""The signal chains: what happens to a signal before it enters a regression, one row for each chain.

A chain has two places to filter. The first is each raw signal, before products are
formed; the second, `finish`, acts on the finished regressors and on the torque or force alike. [D] filters
narrowly in the first place and not at all in the second; products of 2 Hz signals then keep a 4 Hz part
which the filtered torque has lost, and alpha2 comes out 3 to 6 % high. The default filters widely in the
first place and narrowly in the second.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.signals.arrays import Floats, Mask
from impid_host.signals.filters import (
    SavitzkyGolay,
    ZeroPhaseChebyshev,
    ZeroPhaseLowPass,
    central_difference,
    five_point_difference,
)

Operator = Callable[[Floats, float], Floats]


@dataclass(frozen=True, slots=True)
class Chain:
    """How signals are prepared. Operators take (values with time along axis 0, rate in Hz).

    Attributes:
        value, derivative, second_derivative: a raw signal (angles, specific force), smoothed, and its
            derivatives.
        torque: what happens to raw torque and force.
        finish: low-pass on finished regressors and targets, or None.
        edge_s: what is dropped at each end and beside each gap, where filters have not settled.
        decimate: keep every so many samples for estimation; None: as many as the bandwidth asks for.
        ar_order: highest order of the residual's autoregression by which rows are prewhitened; 0: plain
            least squares.
    """

    name: str
    value: Operator
    derivative: Operator
    second_derivative: Operator
    torque: Operator
    finish: ZeroPhaseLowPass | ZeroPhaseChebyshev | None
    edge_s: float
    decimate: int | None
    ar_order: int

    def decimation(self, rate_hz: float) -> int:
        """Keep one sample in so many: 2.2 per cycle of the cut-off leave filtered noise about white."""
        if self.decimate is not None:
            return self.decimate
        return max(1, int(rate_hz / (2.2 * self.cutoff_hz)))

    @property
    def cutoff_hz(self) -> float:
        """Of the narrow filter, wherever it stands."""
        return self.finish.cutoff_hz if self.finish is not None else PUBLISHED_CUTOFF_HZ

    def with_cutoff(self, cutoff_hz: float) -> "Chain":
        """The same chain with another cut-off of its narrow filter.

        Raises:
            UndeterminedError: the chain's filters are fixed by the paper it reproduces.
        """
        if not isinstance(self.finish, ZeroPhaseLowPass):
            raise UndeterminedError(
                f"the chain {self.name!r} has a fixed cut-off; --cutoff goes with --chain default"
            )
        edge = max(0.25, 4.5 / cutoff_hz)
        return replace(self, finish=replace(self.finish, cutoff_hz=cutoff_hz), edge_s=edge)


PUBLISHED_CUTOFF_HZ = 4.5
_WIDE = ZeroPhaseLowPass(order=4, cutoff_hz=60.0)
_NARROW = ZeroPhaseLowPass(order=5, cutoff_hz=PUBLISHED_CUTOFF_HZ)
_SAVGOL = SavitzkyGolay(order=6, window_s=0.151)
_EMPS = ZeroPhaseLowPass(order=4, cutoff_hz=100.0)


def _wide(values: Floats, rate_hz: float) -> Floats:
    return values if rate_hz < 4 * _WIDE.cutoff_hz else _WIDE.apply(values, rate_hz)


class _After(tuple[Operator, ...]):
    """One operator after the other; a class, so that a chain can be sent to another process."""

    __slots__ = ()

    def __call__(self, values: Floats, rate_hz: float) -> Floats:
        for step in self:
            values = step(values, rate_hz)
        return values


def _unchanged(values: Floats, _rate_hz: float) -> Floats:
    return values


DEFAULT = Chain(
    name="default",
    value=_wide,
    derivative=_After((_wide, five_point_difference)),
    second_derivative=_After((_wide, five_point_difference, five_point_difference)),
    torque=_unchanged,
    finish=_NARROW,
    edge_s=1.0,
    decimate=None,
    ar_order=8,
)

PUBLISHED = Chain(
    name="published",
    value=_After((_SAVGOL.smooth, _NARROW.apply)),
    derivative=_After((_SAVGOL.differentiate, _NARROW.apply)),
    second_derivative=_After((_SAVGOL.differentiate_twice, _NARROW.apply)),
    torque=_After((_SAVGOL.smooth, _NARROW.apply)),
    finish=None,
    edge_s=1.0,
    decimate=None,
    ar_order=0,
)

# Janot, Gautier and Brunot's processing of the EMPS benchmark: 100 Hz, central differences, 50 border
# samples, MATLAB's decimation by 10 of regressors and force.
EMPS = Chain(
    name="emps",
    value=_EMPS.apply,
    derivative=_After((_EMPS.apply, central_difference)),
    second_derivative=_After((_EMPS.apply, central_difference, central_difference)),
    torque=_unchanged,
    finish=ZeroPhaseChebyshev(order=8, ripple_dB=0.05, cutoff_hz=40.0),
    edge_s=0.05,
    decimate=10,
    ar_order=0,
)

CHAINS: dict[str, Chain] = {chain.name: chain for chain in (DEFAULT, PUBLISHED, EMPS)}


def erode(valid: Mask, samples: int) -> Mask:
    """Drop `samples` at both ends and beside every gap: `valid` (N,) -> (N,)."""
    if samples <= 0:
        return valid
    ends = np.ones(samples + 1, dtype=np.int64)
    bad_before = np.cumsum(np.concatenate([[0], ends, ~valid, ends]))
    result: Mask = bad_before[2 * samples + 2 : -1] == bad_before[1 : -(2 * samples + 2)]
    return result
