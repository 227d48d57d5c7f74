"""Zero-phase filters, each the same whatever signal it is given: arrays in, arrays out, along axis 0."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.signals.arrays import Floats
from impid_host.signals.recursive import butterworth_sections, recursive


def _below_half(cutoff_hz: float, rate_hz: float) -> float:
    """The cut-off, if a signal of this rate has one.

    Raises:
        UndeterminedError: it does not lie below half the rate.
    """
    if cutoff_hz >= 0.5 * rate_hz:
        raise UndeterminedError(
            f"signals at {rate_hz:.4g} Hz have no part at {cutoff_hz:.4g} Hz to filter; log faster, or take "
            "a lower --cutoff or another --chain"
        )
    return cutoff_hz


@dataclass(frozen=True, slots=True)
class Sections:
    """A filter's sections of second order at most, (k, 6): b0, b1, b2, 1, a1, a2 of each."""

    sos: Floats

    def forth_and_back(self, values: Floats, pad: int | None = None) -> Floats:
        """Along axis 0 and back again, so that there is no phase; columns of zeros cost nothing.

        Args:
            pad: values are continued so far by point reflection; by default three times the filter's length.
        """
        if pad is None:
            least = min(int(np.sum(self.sos[:, 2] == 0)), int(np.sum(self.sos[:, 5] == 0)))
            pad = 3 * (2 * len(self.sos) + 1 - least)
        if len(values) <= pad:
            raise ValueError(f"{len(values)} rows are no more than the {pad} by which they are continued")
        plain = values.reshape(len(values), -1)
        used = np.flatnonzero(plain.any(axis=0))
        longer = np.empty((len(values) + 2 * pad, len(used)), order="F")
        rows = longer[pad : pad + len(values)]
        rows[:] = plain[:, used] if len(used) < plain.shape[1] else plain
        longer[:pad] = 2 * rows[:1] - rows[pad:0:-1]
        longer[pad + len(values) :] = 2 * rows[-1:] - rows[-2 : -pad - 2 : -1]
        back = self._once(self._once(longer)[::-1])[::-1]
        result = np.zeros(plain.shape)
        result[:, used] = back[pad : pad + len(values)]
        return result.reshape(values.shape)

    def gain(self, frequency_hz: Floats, rate_hz: float) -> Floats:
        """Magnitude of the response of one run, (F,)."""
        delay = np.exp(-2j * np.pi * np.multiply.outer(frequency_hz / rate_hz, np.arange(3)))
        top, bottom = delay @ self.sos[:, :3].T, delay @ self.sos[:, 3:].T
        return np.asarray(np.abs(np.prod(top / bottom, axis=1)))

    def _once(self, rows: Floats) -> Floats:
        """From where the first value has been there for ever, (N, k) along axis 0."""
        return recursive(self.sos, rows, settled=True)


@lru_cache(maxsize=64)
def butterworth(order: int, cutoff_hz: float, rate_hz: float) -> Sections:
    """The low-pass."""
    return Sections(butterworth_sections(order, cutoff_hz, rate_hz))


@lru_cache(maxsize=64)
def chebyshev(order: int, ripple_dB: float, cutoff_hz: float, rate_hz: float) -> Sections:
    """A Chebyshev low-pass of type I."""
    from scipy import signal  # noqa: PLC0415  (half a second, for one chain that few ask for)

    return Sections(np.asarray(signal.cheby1(order, ripple_dB, cutoff_hz, fs=rate_hz, output="sos")))


@dataclass(frozen=True, slots=True)
class ZeroPhaseLowPass:
    """A Butterworth low-pass run forwards and backwards (filtfilt): no phase, the gain squared.

    Args:
        order: of the filter that is run twice.
        cutoff_hz: its -3 dB frequency; the zero-phase filter has -6 dB there.
    """

    order: int
    cutoff_hz: float

    def apply(self, values: Floats, rate_hz: float) -> Floats:
        """Filter along axis 0; any trailing shape."""
        cutoff_hz = _below_half(self.cutoff_hz, rate_hz)
        sections = butterworth(self.order, cutoff_hz, rate_hz)
        pad = min(len(values) - 1, int(3 * rate_hz / self.cutoff_hz))
        return sections.forth_and_back(values, pad)

    def gain(self, frequency_hz: Floats, rate_hz: float) -> Floats:
        """Magnitude response of the two runs together."""
        return butterworth(self.order, self.cutoff_hz, rate_hz).gain(frequency_hz, rate_hz) ** 2


@dataclass(frozen=True, slots=True)
class ZeroPhaseChebyshev:
    """A Chebyshev type I low-pass run forwards and backwards, as in MATLAB's `decimate`."""

    order: int
    ripple_dB: float
    cutoff_hz: float

    def apply(self, values: Floats, rate_hz: float) -> Floats:
        """Filter along axis 0; any trailing shape."""
        cutoff_hz = _below_half(self.cutoff_hz, rate_hz)
        sections = chebyshev(self.order, self.ripple_dB, cutoff_hz, rate_hz)
        return sections.forth_and_back(values)


@dataclass(frozen=True, slots=True)
class SavitzkyGolay:
    """[D] Sec. III-A: a polynomial of `order` through `window_s` around each instant, read at its centre."""

    order: int
    window_s: float

    def _window(self, rate_hz: float) -> int:
        return max(2 * round((self.window_s * rate_hz - 1) / 2) + 1, self.order + 1 + self.order % 2)

    def smooth(self, values: Floats, rate_hz: float) -> Floats:
        """The smoothed signal, along axis 0."""
        return self._derivative(values, rate_hz, 0)

    def differentiate(self, values: Floats, rate_hz: float) -> Floats:
        """The first derivative, per s, along axis 0."""
        return self._derivative(values, rate_hz, 1)

    def differentiate_twice(self, values: Floats, rate_hz: float) -> Floats:
        """The second derivative, per s^2, along axis 0."""
        return self._derivative(values, rate_hz, 2)

    def _derivative(self, values: Floats, rate_hz: float, times: int) -> Floats:
        window = self._window(rate_hz)
        from scipy import signal  # noqa: PLC0415  (half a second, for one chain that few ask for)

        result: Floats = signal.savgol_filter(
            values, window, self.order, deriv=times, delta=1 / rate_hz, axis=0
        )
        return result


def central_difference(values: Floats, rate_hz: float) -> Floats:
    """(v[k+1] - v[k-1]) rate / 2 along axis 0; one-sided at the two ends."""
    result: Floats = np.gradient(values, 1 / rate_hz, axis=0)
    return result


def windowed_sinc(window: Floats, cutoff: float) -> Floats:
    """Taps (h,), of sum one, of the low-pass at `cutoff` periods per sample: the ideal's times a window."""
    taps = window * np.sinc(2.0 * cutoff * (np.arange(len(window)) - (len(window) - 1) / 2))
    return np.asarray(taps / taps.sum())


def gaussian(values: Floats, sd_rows: float) -> Floats:
    """(N, k) smoothed along axis 0 by a Gaussian of that standard deviation, mirrored at the ends."""
    reach = int(4.0 * sd_rows + 0.5)
    taps = np.exp(-0.5 * (np.arange(-reach, reach + 1) / max(sd_rows, 1e-9)) ** 2)
    longer = np.pad(values, ((reach, reach), (0, 0)), mode="symmetric")
    return FiniteResponse.of(taps / taps.sum()).apply(longer)


_AT_ONCE = 8  # results of one product of matrices


@dataclass(frozen=True, slots=True)
class FiniteResponse:
    """A finite impulse response at every `step`-th instant, by products of matrices.

    These are several times as fast as a convolution, column by column, of the same taps.

    Attributes:
        taps: of the response, the present instant's first, (h,).
        bands: the taps at each of the instants that are found at once, (m, (m - 1) step + h).
    """

    step: int
    taps: Floats
    bands: Floats

    @classmethod
    def of(cls, taps: Floats, step: int = 1) -> "FiniteResponse":
        """The response with these taps (h,)."""
        at_once = max(_AT_ONCE, len(taps) // step)
        bands = np.zeros((at_once, (at_once - 1) * step + len(taps)))
        for k, row in enumerate(bands):
            row[k * step : k * step + len(taps)] = taps[::-1]
        return cls(step, taps, bands)

    def apply(self, values: Floats, before: int = 0) -> Floats:
        """(N, k) -> ((N + 2 * before - h) // step + 1, k), with so many rows of zeros at either end.

        With `before` = h // 2 a symmetric response of an odd number of taps comes out at every step-th of all
        instants; with none, only where all taps are on values.
        """
        m, width = self.bands.shape
        count = (len(values) + 2 * before - len(self.taps)) // self.step + 1
        if count < 1:
            return np.zeros((0, values.shape[1]))
        pieces = -(-count // m)
        padded = np.zeros(((pieces - 1) * m * self.step + width, values.shape[1]))
        fits = min(len(values), len(padded) - before)
        padded[before : before + fits] = values[:fits]
        windows = np.lib.stride_tricks.as_strided(
            padded, (pieces, width, values.shape[1]), (m * self.step * padded.strides[0], *padded.strides)
        )
        result: Floats = np.matmul(self.bands, windows).reshape(pieces * m, -1)[:count]
        return result
