"""Cubic splines through columns of values, without the modules that importing `scipy.interpolate` brings.

A trial is a few long columns: each is worked on by itself, so that it stays in the processor's cache.
"""

import numpy as np

from impid_host.signals.arrays import Floats


class Spline:
    """The cubic spline with continuous third derivatives beside its ends ("not a knot"), as SciPy's.

    Args:
        t: strictly increasing, (N,), two at least; values: (N, ...).

    Raises:
        ValueError: fewer than two instants, or instants that do not increase.
    """

    def __init__(self, t: Floats, values: Floats) -> None:
        step = np.diff(t)
        if len(step) == 0 or not (step > 0).all():
            raise ValueError("a spline needs two instants or more, each later than the last")
        self._t, self._trailing = t, values.shape[1:]
        # Columns (k, N), each in one piece.
        columns = np.ascontiguousarray(values.reshape(len(t), -1).T, dtype=np.float64)
        chord = np.diff(columns, axis=1) / step
        slope = _slopes(step, chord)
        self._value, self._slope = columns, slope
        bend = (slope[:, :-1] + slope[:, 1:] - 2.0 * chord) / step
        self._square = (chord - slope[:, :-1]) / step - bend
        self._cube = bend / step

    def __call__(self, at: Floats) -> Floats:
        """Values at `at` (M,), beyond the ends by the outermost cubics: (M, ...)."""
        place = np.searchsorted(self._t[1:-1], at, side="right")
        ahead = at - self._t[place]
        result = np.empty((len(self._value), len(at)))
        for column in range(len(result)):
            own = self._cube[column, place]
            for coefficients in (self._square, self._slope, self._value):
                own *= ahead
                own += coefficients[column, place]
            result[column] = own
        return result.T.reshape(len(at), *self._trailing)


def _slopes(step: Floats, chord: Floats) -> Floats:
    """Slopes at the instants by the chords between them: (N - 1,), (k, N - 1) -> (k, N)."""
    if len(step) == 1:
        return np.repeat(chord, 2, axis=1)
    if len(step) == 2:  # one parabola
        bend = np.diff(chord, axis=1) / (step[0] + step[1])
        return np.concatenate([chord - bend * step, chord[:, 1:] + bend * step[1]], axis=1)
    from scipy.linalg import lapack  # noqa: PLC0415  (a tenth of a second, which starting can do without)

    first, last = step[0] + step[1], step[-1] + step[-2]
    below = np.append(step[1:], last)
    above = np.insert(step[:-1], 0, first)
    middle = np.concatenate([step[1:2], 2.0 * (step[:-1] + step[1:]), step[-2:-1]])
    right = np.empty((len(chord), len(middle)))
    right[:, 1:-1] = 3.0 * (step[1:] * chord[:, :-1] + step[:-1] * chord[:, 1:])
    right[:, 0] = ((step[0] + 2 * first) * step[1] * chord[:, 0] + step[0] ** 2 * chord[:, 1]) / first
    right[:, -1] = (step[-1] ** 2 * chord[:, -2] + (2 * last + step[-1]) * step[-2] * chord[:, -1]) / last
    solved: Floats
    *_, solved, failed = lapack.dgtsv(below, middle, above, right.T, 1, 1, 1, 1)
    if failed:
        raise ValueError("a spline's instants are too close together to tell apart")
    return solved.T
