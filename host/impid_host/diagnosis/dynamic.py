"""Linear dynamics without a cause: a torque that follows the motion by any response in frequency.

A resonance, a leaky filter, a compliance of the wrong sign: none is in the catalogue, and all of them look a
little like springs, delays and masses that are.
"""

from collections.abc import Iterator

import numpy as np

from impid_host.diagnosis.result import UNATTRIBUTED
from impid_host.effects.effect import Candidate, Setting, at_tip, on_joint
from impid_host.effects.view import Columns, View
from impid_host.signals.arrays import Floats

NODES_HZ = (0.3, 0.6, 0.9, 1.25, 1.6, 2.0, 2.6, 3.4, 4.5)
# Nobody moves faster: above, an acceleration is the encoders' noise, which the torque model passes on.
_ENDS_HZ = (0.0, 6.0)
RESPONSE = "response"


def response_candidates(setting: Setting) -> Iterator[Candidate]:
    """Each joint's torque after its own acceleration; each component of the end-effector's force likewise."""
    for joint in range(setting.joints):

        def own(view: View, _shape: float, joint: int = joint) -> Columns:
            return on_joint(view, joint, *filtered(view.acc[:, joint], view.dt))

        yield _candidate(f"tau{joint + 1}", own, f"theta{joint + 1}")
    if not setting.planar:
        return
    for axes in ((0,), (1,), (0, 1)):

        def pulled(view: View, _shape: float, axes: tuple[int, ...] = axes) -> Columns:
            if view.load is None:
                return {}
            bands = [_along(view, axis, c) for axis in axes for c in filtered(view.a[:, axis], view.dt)]
            return at_tip(view, *bands)

        letters = ["xy"[axis] for axis in axes]
        yield _candidate(f"f{letters[0]}", pulled, " and ".join(letters), len(axes))


def is_response(candidate: Candidate) -> bool:
    """Whether it is one of these, and not a part of another."""
    return candidate.variant.startswith(RESPONSE) and not candidate.variant.endswith((" x", " to y"))


def filtered(values: Floats, dt: float) -> list[Floats]:
    """`values` (N,) in triangular bands of frequency, each in phase and a quarter turn late.

    Any sum of them is a response that is linear in frequency between the nodes.
    """
    count = len(values)
    size = 2 * count  # the other half is silence, so that the end does not reach the beginning
    spectrum = np.fft.rfft(values, size)
    frequency = np.fft.rfftfreq(size, dt)
    result: list[Floats] = []
    nodes = (_ENDS_HZ[0], *NODES_HZ, _ENDS_HZ[1])
    for node in range(1, len(nodes) - 1):
        weight = np.interp(frequency, nodes, np.eye(len(nodes))[node])
        result += [np.fft.irfft(spectrum * weight * turn, size)[:count] for turn in (1.0, -1j)]
    return result


def _along(view: View, axis: int, column: Floats) -> Floats:
    force = np.zeros_like(view.x)
    force[:, axis] = column
    return force


def _candidate(on: str, columns: object, of: str, signals: int = 1) -> Candidate:
    return Candidate(
        UNATTRIBUTED,
        (on, "frequency"),
        columns,  # type: ignore[arg-type]
        lambda _beta, _shape: {},
        size=2 * len(NODES_HZ) * signals,
        variant=f"{RESPONSE} to {of}",
    )
