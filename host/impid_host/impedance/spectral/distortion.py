"""Even and odd nonlinear distortion from one realisation of an odd-random multisine.

Source: R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, ch. 4 (fast
    method). Only
some odd harmonics are excited. A linear system answers at those alone; terms even in the signal (asymmetric
stiffness) answer at even harmonics, odd ones (friction, cubic springs) at the odd gaps.
"""

from dataclasses import dataclass

import numpy as np
from scipy import special

from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.arrays import Complexes, Floats
from impid_host.impedance.spectral.best_linear import NONLINEAR_P_VALUE, effective_count


@dataclass(frozen=True, slots=True)
class DistortionLevels:
    """Root mean square amplitude per line, in the output's unit, up to the highest excited frequency.

    Attributes:
        excited: at excited lines.
        odd: at odd lines that were not excited, noise taken off.
        even: at even lines, noise taken off.
        noise: of the averaged periods, per line.
        p_odd, p_even: that the odd, the even lines hold noise alone.
        line: all harmonics up to the highest excited one, shape (n_l,); kind: 0 excited, 1 odd, 2 even.
        amplitude: at excited lines of the output, at the others of what the input does not explain;
            line_noise: of the averaged periods; both shape (n_l,).
    """

    excited: float
    odd: float
    even: float
    noise: float
    p_odd: float
    p_even: float
    line: np.ndarray[tuple[int], np.dtype[np.int64]]
    kind: np.ndarray[tuple[int], np.dtype[np.int64]]
    amplitude: Floats
    line_noise: Floats

    @property
    def verdict(self) -> str:
        """One sentence for the lab book."""
        found = []
        if self.p_odd < NONLINEAR_P_VALUE:
            found.append(
                f"odd distortion ({100 * self.odd / self.excited:.2g} %), as of friction or a cubic spring"
            )
        if self.p_even < NONLINEAR_P_VALUE:
            found.append(
                f"even distortion ({100 * self.even / self.excited:.2g} %), as of an asymmetric stiffness"
            )
        if not found:
            noise = 100 * self.noise / self.excited
            return f"no distortion above the noise ({noise:.2g} % of the excited lines)"
        return " and ".join(found)

    def __str__(self) -> str:
        return f"distortion: {self.verdict}"


def distortion_levels(
    u: Floats,
    y: Floats,
    harmonics: np.ndarray[tuple[int], np.dtype[np.int64]],
    response: Complexes | None = None,
) -> DistortionLevels:
    """Levels at excited, odd and even lines of one output, over all experiments with these lines.

    What the measured input carries into the gaps (an imperfect actuator, a robot's friction) is taken off by
    the response that the excited lines show.

    Args:
        u: inputs, shape (E, P, N, n): experiments, steady periods, samples, inputs; or (P, N) of one input in
            one experiment.
        y: output, shape (E, P, N), or (P, N).
        harmonics: excited ones, all odd, shape (n_f,).
        response: from each input to the output at every line up to the highest excited one, shape (n_l, n);
            of a single input by default y over u, interpolated.

    Raises:
        UndeterminedError: fewer than two periods, or no odd line left free.
    """
    P, N = y.shape[-2:]
    lines = np.arange(1, int(harmonics.max()) + 1)
    free = ~np.isin(lines, harmonics)
    odd, even = free & (lines % 2 == 1), lines % 2 == 0
    if P < 2:
        raise UndeterminedError("telling distortion from noise needs at least two periods")
    if np.any(harmonics % 2 == 0) or not np.any(odd):
        raise UndeterminedError("the multisine must excite odd harmonics only and leave some of them out")
    U = np.fft.rfft(u.reshape(-1, P, N, u.shape[-1] if u.ndim == 4 else 1), axis=2)[:, :, lines] * (2.0 / N)
    Y = np.fft.rfft(y.reshape(-1, P, N), axis=2)[:, :, lines] * (2.0 / N)
    if response is None:
        G = (Y.mean(axis=(0, 1)) / U[..., 0].mean(axis=(0, 1)))[~free]
        between = np.interp(lines, lines[~free], G.real) + 1j * np.interp(lines, lines[~free], G.imag)
        response = between[:, np.newaxis]
    rest = Y - np.einsum("epfj,fj->epf", U, response)
    mean = rest.mean(axis=1)
    noise = np.sum(np.abs(rest - mean[:, np.newaxis]) ** 2, axis=1) / (P - 1) / P
    odd_rms, p_odd = _level(mean[:, odd], noise[:, odd], P)
    even_rms, p_even = _level(mean[:, even], noise[:, even], P)
    answer: Floats = np.sqrt(np.mean(np.abs(Y.mean(axis=1)) ** 2, axis=0))
    left: Floats = np.sqrt(np.mean(np.abs(mean) ** 2, axis=0))
    return DistortionLevels(
        float(np.sqrt(np.mean(answer[~free] ** 2))),
        odd_rms,
        even_rms,
        float(np.sqrt(np.mean(noise[:, free]))),
        p_odd,
        p_even,
        lines,
        np.where(~free, 0, np.where(odd, 1, 2)),
        np.asarray(np.where(free, left, answer)),
        np.sqrt(noise.mean(axis=0)),
    )


def _level(mean: Complexes, noise: Floats, P: int) -> tuple[float, float]:
    """Rms beyond the noise, and the p-value of the lines' power against the scatter between periods.

    Args:
        mean, noise: per experiment and line, shape (E, lines).
    """
    power, floor = float(np.mean(np.abs(mean) ** 2)), float(np.mean(noise))
    ratio = power / floor if floor > 0 else np.inf
    # Few loud lines decide over a sum of unequal ones.
    count = len(mean) * effective_count(noise.mean(axis=0))
    p_value = float(special.fdtrc(2 * count, 2 * count * (P - 1), ratio))
    return float(np.sqrt(max(0.0, power - floor))), p_value
