"""Effects with a name of the catalogue in forms, places and trials that the first book does not have: the machine.

What a name means stands in the diagnosis format; these are the same causes in another week of a laboratory: in some
trials only, with another value in each trial, at one joint where it was both, with the other sign, with another law.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator

from ..mechanics import Array
from ..motion import Motion
from .base import Effect, play, shifted, sign
from .machine import Cable, Cogging, DryFriction, JointSpring, SoftTransmission, TiltedTable, TipDamping

SENSOR = frozenset({"force_sensor"})


def by_trial(m: Motion, salt: int, low: float, high: float) -> Array:
    """Two factors of a trial between low and high, of either sign; (2,)."""
    rng = m.rng(salt)
    return np.asarray(rng.uniform(low, high, 2) * rng.choice([-1, 1], 2))


class SealInFreeTrials(DryFriction):
    """A dust cover rubs in the free trials and was taken off for the loads."""

    whens = ("free",)


class FrictionByTrial(DryFriction):
    """A holding brake drags, in each trial by another torque."""

    def reaction(self, m: Motion, tau: Array) -> Array:
        return self.amount * self.shares * np.abs(by_trial(m, self.salt, 0.4, 1.6)) * sign(m.omega)


class FrictionInLoadTrials(DryFriction):
    """The load's bearing plate rubs on a link's hub: dry friction at a joint, in load trials only."""

    whens, needs = ("load",), SENSOR


class MaxwellSlipInJoint(Effect):
    """Friction as three springs in parallel, each of which slides at its own width (Maxwell slip)."""

    name, with_, start = "friction.presliding", ("friction.coulomb",), 0.05

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.widths = rng.uniform(0.01, 0.05) * np.array([0.3, 1.0, 2.0])

    def reaction(self, m: Motion, tau: Array) -> Array:
        out = np.zeros_like(m.theta)
        for j in np.flatnonzero(self.mask):
            angle = m.theta[:, j]
            out[:, j] = sum((angle - play(angle, w)) / w for w in self.widths) / 3
        return self.amount * self.shares * out

    def parameters(self) -> dict[str, Any]:
        return {"torque": self.per_joint(self.amount * self.shares), "width_rad": self.widths.tolist()}


class ViscosityByAngle(Effect):
    """A bearing out of round: viscous friction with a wave over the angle."""

    name, start = "friction.position", 0.05

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0)
        self.period, self.phase = float(rng.uniform(0.15, 0.5)), float(rng.uniform(0, 2 * np.pi))

    def reaction(self, m: Motion, tau: Array) -> Array:
        wave = 1 + 0.9 * np.cos(2 * np.pi * m.theta / self.period + self.phase)
        return self.amount * self.shares * wave * m.omega

    def parameters(self) -> dict[str, Any]:
        return {"viscous": self.per_joint(self.amount * self.shares), "period_rad": self.period}


class UnequalSlopes(Effect):
    """Dry friction unequal in the two directions, and drag that is unequal with it."""

    name, with_, start = "friction.asymmetric", ("friction.coulomb",), 0.05
    instead = (("friction.coulomb", "actuator.offset"),)

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.back, self.slope = float(rng.uniform(0.1, 0.5)), float(rng.uniform(0.2, 0.8))
        self.way = rng.choice([-1, 1], 2)

    def reaction(self, m: Motion, tau: Array) -> Array:
        s = sign(m.omega)
        forward = s * self.way > 0
        torque = np.where(forward, s + self.slope * m.omega, self.back * s)
        return self.amount * self.shares * torque

    def parameters(self) -> dict[str, Any]:
        return {"torque": self.per_joint(self.amount * self.shares), "back": self.back, "slope": self.slope}


class SteepStribeck(Effect):
    """Friction that is high below a few hundredths of a radian a second only."""

    name, with_, start = "friction.stribeck", ("friction.coulomb",), 0.05

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0)
        self.speed = float(rng.uniform(0.02, 0.04))

    def reaction(self, m: Motion, tau: Array) -> Array:
        rise = 1.5 * np.exp(-((m.omega / self.speed) ** 2))
        return self.amount * self.shares * sign(m.omega) * (0.5 + rise)

    def parameters(self) -> dict[str, Any]:
        return {"torque": self.per_joint(self.amount * self.shares), "speed": self.speed}


class CableInFreeTrials(Cable):
    """A calibration lead hangs on the end point in the free trials; the force sensor knows the loads' side."""

    whens, needs = ("free",), SENSOR


class RubberBandAfar(Cable):
    """A long rubber band to a far hook: a soft spring along one line with a large constant pull, in all trials."""

    def draw(self, rng: Generator) -> None:
        way = rng.uniform(0, 2 * np.pi)
        line = np.array([np.cos(way), np.sin(way)])
        self.K = np.outer(line, line)
        self.rest = self.lab.home + rng.uniform(0.2, 0.5) * line


class JointSpringInLoadTrials(JointSpring):
    """The sensor's cable runs along a link and is there in load trials only."""

    whens, needs = ("load",), SENSOR


class HeavyRotorBehindSpring(SoftTransmission):
    """At one joint most of the inertia is the motor's, and the shaft is soft."""

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0)
        self.rotor = rng.uniform(0.45, 0.7, 2) * np.array([self.lab.robot.alpha[0], self.lab.robot.alpha[2]])


class DamperInLoadTrials(TipDamping):
    """A dashpot bolted to the table is hooked on for the loads."""

    whens, needs = ("load",), SENSOR


class DampedAlongOneLine(TipDamping):
    """A dashpot with one axis: no damping across it."""

    def draw(self, rng: Generator) -> None:
        way = rng.uniform(0, np.pi)
        line = np.array([np.cos(way), np.sin(way)])
        self.B = np.outer(line, line)


class TiltInLoadTrials(TiltedTable):
    """The table was moved between the free trials and the loads, and is level no more."""

    whens, needs = ("load",), SENSOR


class HandleInFreeTrials(Effect):
    """A dummy tool was left on the end point in the free trials only."""

    name, whens, needs, start, most = "inertia.extra", ("free",), SENSOR, 0.05, 1.0

    def reaction(self, m: Motion, tau: Array) -> Array:
        return m.robot.to_joints(m.theta, self.amount * m.a)

    def parameters(self) -> dict[str, Any]:
        return {"mass": self.amount}


class GainInLoadTrials(Effect):
    """The drives were switched to another range for the loads."""

    name, whens, needs, start, most = "actuator.gain", ("load",), SENSOR, 0.03, 0.5

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)
        self.shares = self.shares * rng.choice([-1, 1])

    def drive(self, m: Motion, tau: Array) -> Array:
        return tau / (1 + self.amount * self.shares)

    def parameters(self) -> dict[str, Any]:
        return {"gain": self.per_joint(1 + self.amount * self.shares)}


class OffsetByTrial(Effect):
    """The drive's zero is set anew at each start: a constant torque of its own in each trial."""

    name, start = "actuator.offset", 0.02

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng)

    def drive(self, m: Motion, tau: Array) -> Array:
        return tau - self.amount * self.shares * by_trial(m, self.salt, 0.4, 1.5)

    def parameters(self) -> dict[str, Any]:
        return {"torque": self.per_joint(self.amount * self.shares), "by_trial": "0.4 to 1.5, either sign"}


class FewPoles(Cogging):
    """A direct drive with few poles: cogging of some waves a radian, at both joints."""

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=1.0)
        self.cycles, self.phase = rng.uniform(7, 13, 2), rng.uniform(0, 2 * np.pi, 2)


class CoggingPhaseByTrial(Cogging):
    """The power was off between trials: the ripple comes back with another phase in each."""

    def reaction(self, m: Motion, tau: Array) -> Array:
        phase = m.rng(self.salt).uniform(0, 2 * np.pi, 2)
        return self.amount * self.shares * np.sin(self.cycles * m.theta + phase)


class OneTorqueLate(Effect):
    """One drive's torque comes over a slower bus than the other's."""

    name, start, most = "actuator.delay", 0.003, 0.06

    def draw(self, rng: Generator) -> None:
        self.pick_joints(rng, both=0)

    def drive(self, m: Motion, tau: Array) -> Array:
        return np.where(self.mask > 0, shifted(tau, self.amount, m.t), tau)

    def parameters(self) -> dict[str, Any]:
        return {"delay": self.per_joint(self.amount * self.mask)}


ALL: list[type[Effect]] = [
    SealInFreeTrials, FrictionByTrial, FrictionInLoadTrials, MaxwellSlipInJoint, ViscosityByAngle, UnequalSlopes,
    SteepStribeck, CableInFreeTrials, RubberBandAfar, JointSpringInLoadTrials, HeavyRotorBehindSpring,
    DamperInLoadTrials, DampedAlongOneLine, TiltInLoadTrials, HandleInFreeTrials, GainInLoadTrials, OffsetByTrial,
    FewPoles, CoggingPhaseByTrial, OneTorqueLate,
]  # fmt: skip
