"""Robot, hold and load as one linear system, M d'' + B d' + K d each: how a perturbation moves them.

F = D_load d + e, p - F = D_robot d: hence (D_load + D_robot) d = p - e, with e the force that the load adds
by itself.
"""

from dataclasses import dataclass

import numpy as np
import scipy.fft

from impid_host.impedance.spectral.arrays import Complexes, Floats
from impid_host.impedance.spectral.second_order import SecondOrderFit

# Silence behind a record, so that what rings on does not come round to its beginning.
_SILENCE_S = 30.0


@dataclass(frozen=True, slots=True)
class Spectrum:
    """The frequencies of a padded record of `samples` at `fs`: f (Hz), shape (n_f,), of an FFT of n_fft."""

    samples: int
    fs: float
    n_fft: int
    f: Floats

    @staticmethod
    def of(samples: int, fs: float) -> "Spectrum":
        """Padded with silence."""
        n_fft = int(scipy.fft.next_fast_len(samples + round(_SILENCE_S * fs), real=True))
        return Spectrum(samples, fs, n_fft, np.arange(n_fft // 2 + 1) * fs / n_fft)

    def forward(self, x: Floats) -> Complexes:
        """(samples, n) -> (n_f, n)."""
        return np.asarray(np.fft.rfft(x, self.n_fft, axis=0))

    def back(self, spectrum: Complexes) -> Floats:
        """(n_f, n) -> (samples, n)."""
        return np.asarray(np.fft.irfft(spectrum, self.n_fft, axis=0)[: self.samples])


def dynamic_stiffness(fit: SecondOrderFit, f: Floats) -> Complexes:
    """D = K + j w B - w^2 M (N/m), shape (n_f, n, n)."""
    jw = 2j * np.pi * f[:, np.newaxis, np.newaxis]
    return np.asarray(fit.K + jw * fit.B + jw**2 * fit.M)


def displacement(stiffness: Complexes, force: Complexes) -> Complexes:
    """D^-1 F, (n_f, n, n) and (n_f, n) -> (n_f, n)."""
    return np.asarray(np.linalg.solve(stiffness, force[:, :, np.newaxis])[:, :, 0])
