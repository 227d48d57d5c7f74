"""Linear dynamics without a cause: a signal that follows the motion by any response in frequency.

A resonance, a leaky filter, a compliance of the wrong sign, a bracket that rings: none is in the catalogue,
and all of them look a little like springs, delays and masses that are.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from impid_host.effects.effect import UNATTRIBUTED, Setting, Term, along, on_joint
from impid_host.effects.view import SPECIFIC_FORCE, TORQUE, Columns, View
from impid_host.signals.arrays import Floats

NODES_HZ = (0.3, 0.6, 0.9, 1.25, 1.6, 2.0, 2.6, 3.4, 4.5)
# Nobody moves faster: above, an acceleration is the encoders' noise, which the torque model passes on.
_ENDS_HZ = (0.0, 6.0)
RESPONSE = "response"


def response_terms(setting: Setting) -> Iterator[Term]:
    """Each joint's torque after its own acceleration; the tip's force and the accelerometer likewise."""
    for joint in range(setting.joints):

        def own(view: View, _shape: float, joint: int = joint) -> Columns:
            return on_joint(view, joint, *filtered(view.acc[:, joint], view.dt))

        yield _term(f"tau{joint + 1}", own, f"theta{joint + 1}")
    if not setting.planar:
        return
    for axis in (0, 1) if setting.loads else ():

        def pulled(view: View, _shape: float, axis: int = axis) -> Columns:
            if view.load is None:
                return {}
            bands = np.stack(filtered(view.a[:, axis], view.dt), axis=1)
            return {TORQUE: view.J[:, axis, :, None] * bands[:, None, :]}

        yield _term(f"f{'xy'[axis]}", pulled, "xy"[axis])
    for axis in (0, 1) if setting.accelerometer else ():

        def felt(view: View, _shape: float, axis: int = axis) -> Columns:
            if view.predicted is None:
                return {}
            bands = [along(c, axis) for c in filtered(view.predicted[:, axis], view.dt)]
            return {SPECIFIC_FORCE: np.stack(bands, axis=2)}

        yield _term(f"acc_{'xy'[axis]}", felt, "xy"[axis])


def is_response(term: Term) -> bool:
    """Whether it is one of these."""
    return term.variant.startswith(RESPONSE)


def filtered(values: Floats, dt: float) -> list[Floats]:
    """`values` (N,) in triangular bands of frequency, each in phase and a quarter turn late.

    Any sum of them is a response that is linear in frequency between the nodes.
    """
    count = len(values)
    size = 2 * count  # the other half is silence, so that the end does not reach the beginning
    used = int(_ENDS_HZ[1] * dt * size) + 1
    spectrum = np.fft.rfft(values, size)[:used] * (2 / size)
    frequency = np.arange(used) / (dt * size)
    nodes = (_ENDS_HZ[0], *NODES_HZ, _ENDS_HZ[1])
    weights = np.stack([np.interp(frequency, nodes, row) for row in np.eye(len(nodes))[1:-1]])
    bands = _synthesised(spectrum * weights, count, size)
    return [part for band in bands for part in (band.real, band.imag)]


def _synthesised(spectra: NDArray[np.complex128], count: int, size: int) -> NDArray[np.complex128]:
    """sum_k s[k] exp(2 pi i k n / size) for n < count: (b, m) -> (b, count).

    Only the first few lines of the spectrum are there, so that a convolution with a chirp of little more than
    `count` instants does it: 2 k n = k^2 + n^2 - (k - n)^2 (Bluestein, IEEE Trans. Audio Electroacoust. 18,
    1970).
    """
    from scipy import fft  # noqa: PLC0415  (slow to import, for searches alone)

    lines = spectra.shape[1]
    padded = fft.next_fast_len(count + lines - 1)
    place = np.arange(max(count, lines))
    chirp = np.exp(1j * np.pi / size * (place**2 % (2 * size)))
    kernel = np.concatenate(
        [chirp[:count], np.zeros(padded - count - lines + 1), chirp[1:lines][::-1]]
    ).conj()
    mixed = fft.ifft(fft.fft(spectra * chirp[:lines], padded) * fft.fft(kernel))
    return np.asarray(mixed[:, :count] * chirp[:count])


def _term(on: str, columns: object, of: str) -> Term:
    return Term(
        UNATTRIBUTED,
        (on, "frequency"),
        columns,  # type: ignore[arg-type]
        lambda _beta, _shape: {},
        size=2 * len(NODES_HZ),
        variant=f"{RESPONSE} to {of}",
    )
