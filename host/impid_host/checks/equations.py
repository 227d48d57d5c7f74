"""Every measured channel of a study as rows of one regression, 10 per second, all filtered alike.

Torques: tau = Y alpha + J^T A q (with an offset and a dry friction of each joint, so that neither passes for
a mistake); forces: -F = A q; accelerations: the accelerometer's along its axes against those of the encoders.
Accelerations in Y and A come from the angles, so that no channel is judged by itself.
"""

from dataclasses import dataclass

import numpy as np

from impid_host.checks.signals import RATE_HZ, Signals, TrialSignals
from impid_host.impedance.loads import load_model
from impid_host.robot.model import RobotModel
from impid_host.signals.arrays import Floats
from impid_host.signals.filters import FiniteResponse, windowed_sinc

_DOWN = 5
_LOW = FiniteResponse.of(windowed_sinc(np.hamming(61), 4.0 / RATE_HZ), _DOWN)
ROWS_HZ = RATE_HZ / _DOWN


def low(values: Floats) -> Floats:
    """Low-pass at 4 Hz and every fifth row, where the filter has settled: (N, ...) -> (R, ...)."""
    return _LOW.apply(values.reshape(len(values), -1)).reshape(-1, *values.shape[1:])


def derivative(values: Floats) -> Floats:
    """Fourth-order central difference along axis 0, per s."""
    slope = np.gradient(values, 1 / RATE_HZ, axis=0)
    if len(values) > 4:
        slope[2:-2] = (values[:-4] - 8 * values[1:-3] + 8 * values[3:-1] - values[4:]) * (RATE_HZ / 12)
    return np.asarray(slope)


def turned(vectors: Floats, angle: Floats | float) -> Floats:
    """Vectors (N, 2) turned by an angle, scalar or (N,)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1]], axis=1)


@dataclass(frozen=True, slots=True)
class Motion:
    """What the angles alone give, R rows; n joints, d axes.

    Attributes:
        robot: the regressor with offsets and dry friction, (R, n, p + 2 n).
        load: J^T A by kind of load, (R, n, q); task: A, (R, d, q).
        felt: what an accelerometer at the end-effector feels along x and y, (R, 2), and along the turning
            axes x' and y'; None where the robot is not planar.
        tip: angle of the end-effector, (N,).
        inertia_of: the inertia matrix by one unit of each of the p parameters at S places visited,
            (S, n, n, p); J_at: the Jacobian there, (S, d, n).
    """

    robot: Floats
    load: dict[str, Floats]
    task: dict[str, Floats]
    felt: dict[str, Floats] | None
    tip: Floats
    inertia_of: Floats
    J_at: Floats
    rows: int


def motion_of(theta: Floats, model: RobotModel, kinds: frozenset[str]) -> Motion:
    """Regressors along angles (N, n) at 50 Hz."""
    omega = derivative(theta)
    theta_dd = derivative(omega)
    J = model.jacobian(theta)
    x = model.position(theta)
    v = np.einsum("kij,kj->ki", J, omega)
    a = np.einsum("kij,kj->ki", J, theta_dd) + np.einsum(
        "kij,kj->ki", model.jacobian_rate(theta, omega), omega
    )
    n = model.joints
    dry = np.tanh(omega / np.maximum(0.05 * np.std(omega, axis=0), 1e-9))
    beside = np.concatenate([np.ones((len(theta), n)), dry], axis=1)
    diagonal = np.concatenate([np.eye(n), np.eye(n)], axis=1)
    Y = np.concatenate([model.regressor(theta, omega, theta_dd), beside[:, None, :] * diagonal], axis=2)
    load, task = {}, {}
    for kind in sorted(kinds - {"free"}):
        A = load_model(kind, tuple(model.task_axes)).regressor(x, v, a)
        task[kind] = low(A)
        load[kind] = low(np.einsum("kdn,kdq->knq", J, A))
    tip = model.tip_angle(theta) if len(model.task_axes) == 2 and n == 2 else np.zeros(len(theta))
    felt = None
    if a.shape[1] == 2 and n == 2:
        base = a - np.array(model.plane_gravity_m_s2)
        felt = {"fixed": low(base), "link2": low(turned(base, -tip))}
    some = slice(None, None, max(1, len(theta) // 40))
    return Motion(
        low(Y),
        load,
        task,
        felt,
        tip,
        _inertia_of(theta[some], model),
        J[some],
        len(low(np.zeros((len(theta), 1)))),
    )


def _inertia_of(theta: Floats, model: RobotModel) -> Floats:
    """What one unit of acceleration of each joint takes, by each parameter: (S, n) -> (S, n, n, p)."""
    rest = np.zeros_like(theta)
    still = model.regressor(theta, rest, rest)
    each = np.eye(model.joints)
    return np.stack([model.regressor(theta, rest, rest + unit) - still for unit in each], axis=2)


class Motions:
    """Motions by angles and robot, kept while they are asked for again and again."""

    def __init__(self, parent: "Motions | None" = None) -> None:
        self._parent = parent
        self._known: dict[tuple[int, object], tuple[Floats, Motion]] = {}

    def child(self) -> "Motions":
        """Motions of a mended study: what it shares is not computed again, and the rest is not kept."""
        return Motions(self)

    def of(self, trial: TrialSignals, study: Signals) -> Motion:
        """The motion of one trial of a study."""
        theta = trial.theta
        key = (id(theta), study.robot)
        found = self._find(key)
        if found is None:
            # The array is kept beside its motion, so that its id is not given away again.
            found = motion_of(theta, study.model, study.kinds)
            self._known[key] = (theta, found)
        return found

    def _find(self, key: tuple[int, object]) -> Motion | None:
        if key in self._known:
            return self._known[key][1]
        return None if self._parent is None else self._parent._find(key)


def force_in_base(trial: TrialSignals, study: Signals, tip: Floats) -> Floats | None:
    """The force sensor's reading along x and y, filtered, (R, 2), N."""
    if trial.force is None:
        return None
    angle = study.force_angle + (tip if study.force_frame == "link2" else 0.0)
    return low(turned(trial.force, angle))
