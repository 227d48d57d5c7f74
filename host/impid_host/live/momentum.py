"""What the load does to the joints, as it happens: the generalised-momentum observer.

The momentum p = M(theta) omega of a robot changes by what its drives, its own dynamics and the load do to it.
All but the load is known, so the load is what is missing; no acceleration is needed, and no derivative:

    r' = gain (tau_load - r)    from    r = gain (p - integral of (tau + C^T omega - friction - gravity + r))

De Luca and Mattone, ICRA 2003 and 2005; M' = C + C^T. `r` follows the load's torque as a first-order low-pass
of time constant 1 / gain.
"""

from dataclasses import dataclass

import numpy as np

from impid_host.robot.terms import RobotStructure
from impid_host.signals.arrays import Floats


@dataclass(frozen=True, slots=True)
class Momentum:
    """Where the observer stands after a row.

    Attributes:
        t: of the row, s.
        p: momentum, (n,), kg m^2/s (kg m/s); known: what changes it besides the load, (n,), N m (N).
        load: torque of the load on the joints, low-passed, (n,), N m (N).
    """

    t: float
    p: Floats
    known: Floats
    load: Floats


def observe(
    structure: RobotStructure,
    value: Floats,
    gain: float,
    before: Momentum | None,
    t: Floats,
    theta: Floats,
    omega: Floats,
    tau: Floats,
) -> tuple[Floats, Momentum]:
    """Torque of the load on the joints at each row, and where the observer then stands.

    Between two rows the load and what is known are taken for constant at their means; rows may be missing.

    Args:
        structure, value: the robot and its parameters, (p,).
        gain: 1/s.
        before: where it stood after the row before; None: it begins at zero.
        t: s, increasing, (N,), N at least 1; theta, omega: (N, n), rad, rad/s (m, m/s).
        tau: of the drives, mean over the sample period centred on t, (N, n), N m (N).
    """
    p, known = _momentum(structure, value, theta, omega)
    known = known + tau
    if before is None:
        before = Momentum(float(t[0]), p[0], known[0], np.zeros_like(p[0]))
    steps = np.diff(t, prepend=before.t)
    change = np.diff(p, axis=0, prepend=before.p[None])
    mean = 0.5 * (known + np.concatenate([before.known[None], known[:-1]]))
    keep = np.exp(-gain * steps)
    rate = np.divide(change, steps[:, None], out=np.zeros_like(change), where=steps[:, None] > 0)
    driven = (1.0 - keep)[:, None] * (rate - mean)
    load = np.empty_like(p)
    last = before.load
    for k in range(len(t)):
        last = keep[k] * last + driven[k]
        load[k] = last
    return load, Momentum(float(t[-1]), p[-1], known[-1], load[-1])


def _momentum(
    structure: RobotStructure, value: Floats, theta: Floats, omega: Floats
) -> tuple[Floats, Floats]:
    """M omega and C^T omega - friction - gravity, (N, n) each, from the one model of the torque.

    C^T omega less all that the motion costs is (C + C^T) omega less the torque without acceleration.
    """
    inertia, without = structure.dynamics(theta, omega, value)
    model = structure.model
    C = model.coriolis(theta, omega, value[: len(model.parameter_names)])
    both = np.einsum("kij,kj->ki", C + np.swapaxes(C, 1, 2), omega)
    return np.einsum("kij,kj->ki", inertia, omega), both - without
