"""The apparatus' first robot in closed form at any instant: two bars, angles from the base, complex numbers.

Nothing of this comes from the code under test, so that an effect can be put in exactly, at any size: a late
signal is the motion at an earlier time, a wrong length is another length in the formula.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from impid_host.effects.catalogue import terms
from impid_host.effects.effect import Term
from impid_host.effects.view import View, with_motion

from .apparatus import ALPHA, INSIDE, L1, L2, MOUNT_RAD, apparatus, by_name

ALL = "all instruments"
MASS, B_HAND = 1.0, 8.0
K = np.array([[300.0, 10.0], [10.0, 200.0]])
X0 = np.array([0.3, 0.1])
FREE, SPRING, HAND = "free_01", "spring_A_01", "hand_01"

_AMPLITUDE = np.array([[0.15, 0.05], [0.12, 0.06]])
_RATE = 2 * np.pi * np.array([[0.55, 1.3], [0.7, 1.1]])
_PHASE = np.array([[0.3, 1.1], [2.0, 0.4]])


@dataclass(frozen=True)
class Body:
    """Angles (N, 2) with two derivatives, and all that follows from them."""

    q: np.ndarray
    w: np.ndarray
    a: np.ndarray
    l1: float = L1
    l2: float = L2

    def _bars(self) -> tuple[np.ndarray, np.ndarray]:
        return self.l1 * np.exp(1j * self.q[:, 0]), -1j * self.l2 * np.exp(1j * self.q[:, 1])

    @property
    def x(self) -> np.ndarray:
        first, second = self._bars()
        return pair(first + second)

    @property
    def v(self) -> np.ndarray:
        e1, e2 = self._bars()
        return pair(1j * self.w[:, 0] * e1 + 1j * self.w[:, 1] * e2)

    @property
    def acc(self) -> np.ndarray:
        e1, e2 = self._bars()
        w, a = self.w, self.a
        return pair((1j * a[:, 0] - w[:, 0] ** 2) * e1 + (1j * a[:, 1] - w[:, 1] ** 2) * e2)

    def lifted(self, force: np.ndarray) -> np.ndarray:
        """Joint torques that hold a force (N, 2) at the tip, by virtual work."""
        e1, e2 = self._bars()
        f = force[:, 0] + 1j * force[:, 1]
        return np.stack([(np.conj(1j * e) * f).real for e in (e1, e2)], axis=1)

    def felt(self) -> np.ndarray:
        """Specific force along the axes of a sensor on the second bar, without gravity."""
        return turned(self.acc, -(self.q[:, 1] + MOUNT_RAD))

    def own(self) -> np.ndarray:
        """Torque of the bars, Tanaka and Takahashi's five numbers."""
        s, c = np.sin(self.q[:, 0] - self.q[:, 1]), np.cos(self.q[:, 0] - self.q[:, 1])
        (w1, w2), (a1, a2) = self.w.T, self.a.T
        t1 = ALPHA[0] * a1 - 0.5 * ALPHA[1] * (s * a2 - c * w2**2) + ALPHA[3] * w1
        t2 = ALPHA[2] * a2 - 0.5 * ALPHA[1] * (s * a1 + c * w1**2) + ALPHA[4] * w2
        return np.stack([t1, t2], axis=1)

    def pulls(self, trial: str) -> np.ndarray:
        """-F of the trial's load."""
        if trial == FREE:
            return np.zeros_like(self.q)
        damper = B_HAND * self.v if trial == HAND else 0.0
        return MASS * self.acc + damper + (self.x - X0) @ K

    def torque(self, trial: str) -> np.ndarray:
        return self.own() + self.lifted(self.pulls(trial))


def body(t: np.ndarray) -> Body:
    """The motion at given times."""
    u = _RATE[:, :, None] * t + _PHASE[:, :, None]
    A, w = _AMPLITUDE[:, :, None], _RATE[:, :, None]
    centre = np.array([0.7, 0.9])[:, None]
    q, rate, acc = A * np.sin(u), A * w * np.cos(u), -A * w**2 * np.sin(u)
    return Body((centre + q.sum(1)).T, rate.sum(1).T, acc.sum(1).T)


def pair(z: np.ndarray) -> np.ndarray:
    return np.stack([z.real, z.imag], axis=1)


def turned(vector: np.ndarray, angle: np.ndarray | float) -> np.ndarray:
    """(N, 2), counter-clockwise."""
    return pair((vector[:, 0] + 1j * vector[:, 1]) * np.exp(1j * np.asarray(angle)))


def recorded(trial: str, motion: Body | None = None) -> View:
    """A trial of that motion as a perfect machine logs it; the encoders may say `motion` instead."""
    plain = by_name(apparatus(ALL).views, trial)
    true = body(plain.t)
    read = motion or true
    view = with_motion(plain, read.q, read.w, read.a)
    assert view.respond is not None
    model = view.respond(view)
    return replace(
        view,
        tau=true.torque(trial),
        measured=true.felt(),
        force=-true.pulls(trial),
        theta_robot=read.q.copy(),
        torque_model=model["torque"],
        response=model,
    )


def term(effect: str, *where: str, variant: str = "", when: str = "all", kind: str = ALL) -> Term:
    """The one term of that name, place and variant."""
    found = [
        own
        for own in terms(apparatus(kind).setting)
        if (own.effect, own.where, own.variant, own.when) == (effect, where, variant, when)
    ]
    assert len(found) == 1, (effect, where, variant, len(found))
    return found[0]


def slope(exact: Callable[[float], np.ndarray], step: float) -> np.ndarray:
    """Derivative at 0 by a central difference of fourth order."""
    near, far = (exact(k * step) - exact(-k * step) for k in (1, 2))
    return (8 * near - far) / (12 * step)


def close(own: np.ndarray, truth: np.ndarray, rel: float = 1e-5) -> bool:
    """Everywhere but at the ends, relative to the largest value."""
    size = float(np.abs(truth[INSIDE]).max())
    return bool(np.abs(own[INSIDE] - truth[INSIDE]).max() <= rel * size)
