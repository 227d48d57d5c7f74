"""The model as a machine that moves: robot and load under a torque law, by Runge and Kutta's steps.

It is what the identification's own regressors say, solved for the accelerations, so that any robot model and
any optional term can be simulated. Many machines run side by side, one for each row of parameters.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.loads import LoadModel
from impid_host.robot.model import RobotModel
from impid_host.robot.terms import RobotStructure
from impid_host.signals.arrays import Floats
from impid_host.signals.systems import solved

_LONGEST_STEP_S = 0.008
_PER_POLE = 0.5  # step times the fastest pole: dry friction jumps, and its error goes with the step
_SPEED = 0.1  # at which the pole is looked for, where dry friction does not switch
_WILD = 1e3  # rad or m from the start: no machine does that


@dataclass(frozen=True, slots=True)
class Law:
    """Torque = u(t) + stiffness theta + damping omega + gain * J' push(t), n joints, d axes.

    Attributes:
        dt: from instant to instant, s.
        u: (T, n); push: (T, d), a force at the end-effector, or None; gain: (n,), its share per joint.
        stiffness, damping: (n, n), of a controller; zero where the torque is what was measured.
    """

    dt: float
    u: Floats
    stiffness: Floats
    damping: Floats
    push: Floats | None = None
    gain: Floats | None = None

    @property
    def t(self) -> Floats:
        """Its instants from 0, s, (T,)."""
        return np.asarray(np.arange(len(self.u)) * self.dt, dtype=np.float64)

    def torque(self, model: RobotModel, theta: Floats, omega: Floats) -> Floats:
        """Along a motion on the law's own instants, (T, n) twice -> (T, n)."""
        tau = self.u + theta @ self.stiffness.T + omega @ self.damping.T
        if self.push is not None and self.gain is not None:
            tau = tau + self.gain * np.einsum("tdn,td->tn", model.jacobian(theta), self.push)
        return np.asarray(tau)


@dataclass(frozen=True, slots=True)
class Machines:
    """B machines of one structure: alpha (B, p), and the load's parameters (B, q) where there is one."""

    structure: RobotStructure
    alpha: Floats
    load: LoadModel | None = None
    value: Floats | None = None

    def __len__(self) -> int:
        return len(self.alpha)

    def times(self, count: int) -> "Machines":
        """All of them, `count` times over."""
        value = None if self.value is None else np.tile(self.value, (count, 1))
        return Machines(self.structure, np.tile(self.alpha, (count, 1)), self.load, value)

    def at(self, b: int, count: int) -> "Machines":
        """Machine b alone, `count` times: to look at it at so many states."""
        value = None if self.value is None else np.tile(self.value[b], (count, 1))
        return Machines(self.structure, np.tile(self.alpha[b], (count, 1)), self.load, value)

    def accelerations(self, theta: Floats, omega: Floats, tau: Floats) -> Floats:
        """theta'' of each machine, (B, n)."""
        count = len(theta)
        inertia, without = self.structure.dynamics(theta, omega, self.alpha)
        rest = tau - without
        if self.load is not None and self.value is not None:
            model = self.structure.model
            J = model.jacobian(theta)
            x, v = model.position(theta), (J @ omega[:, :, None])[:, :, 0]
            curved = (model.jacobian_rate(theta, omega) @ omega[:, :, None])[:, :, 0]
            force = self.load.regressor(x, v, curved) @ self.value[:, :, None]
            d = len(self.load.axes)
            mass = (self.value @ self.load.matrix_map("a").T).reshape(count, d, d)
            J_T = J.transpose(0, 2, 1)
            rest = rest - (J_T @ force)[:, :, 0]
            inertia = inertia + J_T @ mass @ J
        return np.asarray(solved(inertia, rest[:, :, None])[:, :, 0])


def integrate(
    machines: Machines, laws: Sequence[Law], starts: Sequence[tuple[Floats, Floats]]
) -> list[tuple[Floats, Floats]]:
    """Angles and speeds of every machine under every law, each on the law's own T instants: (B, T, n) twice.

    Args:
        starts: angles and speeds at each law's first instant, (B, n) each.

    Raises:
        UndeterminedError: something runs away: nothing holds it, or its law does not.
    """
    from scipy.interpolate import CubicHermiteSpline  # noqa: PLC0415  (slow to import)

    n, B = laws[0].u.shape[1], len(machines)
    every = machines.times(len(laws))
    theta, omega = (np.concatenate([start[k] for start in starts]) for k in range(2))
    step = _step(machines, laws, theta)
    count = int(np.ceil(max(law.t[-1] for law in laws) / step - 1e-9))
    halves = [_halves(law, step, count) for law in laws]
    u, push = (np.stack([half[k] for half in halves]) for k in range(2))
    K, D = np.stack([law.stiffness for law in laws]), np.stack([law.damping for law in laws])
    gain = np.stack([np.zeros(n) if law.gain is None else law.gain for law in laws])
    pushed = any(law.push is not None for law in laws)

    def slope(k: int, theta: Floats, omega: Floats) -> Floats:
        apart = theta.reshape(len(laws), B, n), omega.reshape(len(laws), B, n)
        tau = u[:, k, None] + apart[0] @ np.swapaxes(K, 1, 2) + apart[1] @ np.swapaxes(D, 1, 2)
        if pushed:
            J = machines.structure.model.jacobian(theta).reshape(len(laws), B, -1, n)
            tau = tau + gain[:, None] * np.einsum("rbdn,rd->rbn", J, push[:, k])
        return every.accelerations(theta, omega, tau.reshape(-1, n))

    first, places, speeds = theta, [theta], [omega]
    with np.errstate(all="ignore"):
        for k in range(0, 2 * count, 2):
            a1 = slope(k, theta, omega)
            w2 = omega + 0.5 * step * a1
            a2 = slope(k + 1, theta + 0.5 * step * omega, w2)
            w3 = omega + 0.5 * step * a2
            a3 = slope(k + 1, theta + 0.5 * step * w2, w3)
            w4 = omega + step * a3
            a4 = slope(k + 2, theta + step * w3, w4)
            theta = theta + step / 6 * (omega + 2 * w2 + 2 * w3 + w4)
            omega = omega + step / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
            if not np.all(np.abs(theta - first) < _WILD):
                raise UndeterminedError("nothing holds it")
            places.append(theta)
            speeds.append(omega)
    path = CubicHermiteSpline(np.arange(count + 1) * step, np.array(places), np.array(speeds))
    rate = path.derivative()
    moved = []
    for r, law in enumerate(laws):
        own = slice(r * B, (r + 1) * B)
        moved.append((np.moveaxis(path(law.t)[:, own], 1, 0), np.moveaxis(rate(law.t)[:, own], 1, 0)))
    return moved


def _step(machines: Machines, laws: Sequence[Law], theta: Floats) -> float:
    """s: short beside the fastest pole under the laws; whole samples, where that is more than one."""
    n = laws[0].u.shape[1]
    one = machines.at(0, 2 * n + 1)
    # An arm that is bent has other poles: a dozen postures beside the first, spread over the turn.
    postures = theta[0] + 2 * np.pi * np.outer(np.arange(13), np.sqrt(np.arange(2, n + 2)))
    fastest = 0.0
    for law, posture in product(laws, postures):
        state = np.tile(np.concatenate([posture, np.full(n, _SPEED)]), (2 * n + 1, 1))
        state[1:] += 1e-5 * np.eye(2 * n)
        place, speed = state[:, :n], state[:, n:]
        tau = place @ law.stiffness.T + speed @ law.damping.T
        acc = one.accelerations(place, speed, tau)
        slopes = (acc[1:] - acc[0]).T / 1e-5
        A = np.concatenate([np.eye(2 * n)[n:], slopes])
        fastest = max(fastest, float(np.max(np.abs(np.linalg.eigvals(A)))))
    dt, most = min(law.dt for law in laws), min(_LONGEST_STEP_S, _PER_POLE / max(fastest, 1e-9))
    return dt * int(most / dt) if most > dt else dt / float(np.ceil(dt / most))


def _halves(law: Law, step: float, count: int) -> tuple[Floats, Floats]:
    """u and push at the steps' ends and middles; where a law has ended, its last values stay."""
    from scipy.interpolate import CubicSpline  # noqa: PLC0415  (slow to import)

    at = np.minimum(np.arange(2 * count + 1) * step / 2, law.t[-1])
    push = np.zeros((len(at), 1)) if law.push is None else CubicSpline(law.t, law.push)(at)
    return CubicSpline(law.t, law.u)(at), push
