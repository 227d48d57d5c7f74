"""The plant in C, seen from Python: arrays in, arrays out."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim._native import ffi, lib
from hil_sim.plant.kinematics import position
from hil_sim.plant.physics import INPUTS, PlantEffects, native

Array = NDArray[np.float64]
SUBSTEPS = 8  # IMPID_PLANT_SUBSTEPS: steps of the integration per tick of the controller


@dataclass(frozen=True)
class Load:
    """What is on the end-effector: F_ext = -(M x'' + B x' + K (x - x0)), [D] eqs. 3 and 5.

    Attributes:
        M: shape (2, 2), kg.
        B: shape (2, 2), N s/m.
        K: shape (2, 2), N/m.
        x0: equilibrium in the base frame, shape (2,), m.
    """

    M: Array
    B: Array
    K: Array
    x0: Array

    @classmethod
    def none(cls) -> "Load":
        """Nothing touches the end-effector."""
        zero = np.zeros((2, 2))
        return cls(M=zero, B=zero, K=zero, x0=np.zeros(2))


@dataclass(frozen=True)
class PlantParameters:
    """Everything that the equations of motion and the controller need.

    Attributes:
        alpha: the five robot parameters of [D] Table VI, SI.
        link_lengths_m: l1, l2.
        relative: the second joint's angle is that of its link against the first one.
        believed_lengths_m: what setup and controller take them for; None: the same.
        load: what is on the end-effector.
        counts_per_rev: encoder counts per turn of each joint.
        direction: +1 or -1 for each encoder.
        zero_rad: joint angle at count 0.
        kp: N m/rad per joint.
        kd: N m s/rad per joint.
        velocity_cutoff_Hz: of the controller's filter on differenced encoder readings.
        tick_s: the controller's own idea of its period.
        true_tick_s: how long that period really lasts.
        at_tip: the controller works at the end-effector, [P] eq. 2: kp in N/m, kd in N s/m.
        once_per_turn_rad, phase_rad: eccentricity of the encoders.
        shift_rad: by how much the encoders' readings are too high.
        factor: true angle over the declared one, from count 0.
        effects: what the papers' models lack; None for nothing.
    """

    alpha: tuple[float, float, float, float, float]
    link_lengths_m: tuple[float, float]
    load: Load
    counts_per_rev: tuple[float, float]
    direction: tuple[int, int]
    zero_rad: tuple[float, float]
    kp: tuple[float, float]
    kd: tuple[float, float]
    velocity_cutoff_Hz: float
    tick_s: float = 1e-3
    true_tick_s: float = 1e-3
    at_tip: bool = False
    once_per_turn_rad: tuple[float, float] = (0.0, 0.0)
    phase_rad: tuple[float, float] = (0.0, 0.0)
    shift_rad: tuple[float, float] = (0.0, 0.0)
    factor: tuple[float, float] = (1.0, 1.0)
    believed_lengths_m: tuple[float, float] | None = None
    relative: bool = False
    effects: PlantEffects | None = None

    @property
    def likely_moments_kg_m(self) -> tuple[float, float]:
        """First moments of the links about their axes, as far as alpha tells.

        alpha2 / 2 is l1 times the second link's; the first link's is that of a mass at its end.
        """
        l1 = self.link_lengths_m[0]
        return self.alpha[0] / l1, 0.5 * self.alpha[1] / l1

    @property
    def declared_lengths_m(self) -> tuple[float, float]:
        """The links' lengths as setup and controller believe them."""
        return self.believed_lengths_m or self.link_lengths_m


@dataclass(frozen=True)
class Motion:
    """A stretch of motion. n ticks, 8 n substeps; substep s lasts from grid point s to s + 1.

    Attributes:
        q: angles of the links at the end of each substep, shape (8 n, 2), rad.
        w: their speeds there, shape (8 n, 2), rad/s.
        acceleration: of the end-effector in the base frame, mean over each substep, shape (8 n, 2), m/s^2.
        force: of the load on the robot, mean over each substep, shape (8 n, 2), N.
        crept: by how much the encoders run ahead of the joints there, shape (8 n, 2), rad.
        count: what the controller read at each tick, shape (n, 2).
        torque: what it held from there to the next tick, shape (n, 2), N m.
    """

    q: Array
    w: Array
    acceleration: Array
    force: Array
    crept: Array
    count: NDArray[np.int32]
    torque: Array


class Plant:
    """The robot with its controller and load; keeps its state from one stretch to the next."""

    def __init__(self, parameters: PlantParameters, q_rad: Array) -> None:
        """Puts the robot at rest at q_rad, shape (2,)."""
        p = parameters
        self._lengths = p.link_lengths_m
        scale = [d * c / (2.0 * np.pi) for d, c in zip(p.direction, p.counts_per_rev, strict=True)]
        weight = 1.0 - float(np.exp(-2.0 * np.pi * p.velocity_cutoff_Hz * p.tick_s))
        self._plant = ffi.new(
            "impid_plant *",
            {
                "robot": {
                    "alpha": list(p.alpha),
                    "length": list(p.link_lengths_m),
                    "relative": int(p.relative),
                },
                "load": {
                    "M": p.load.M.ravel().tolist(),
                    "B": p.load.B.ravel().tolist(),
                    "K": p.load.K.ravel().tolist(),
                    "x0": p.load.x0.tolist(),
                },
                "encoder": {
                    "counts_per_rad": scale,
                    "zero_rad": list(p.zero_rad),
                    "once_per_turn": list(p.once_per_turn_rad),
                    "phase_rad": list(p.phase_rad),
                    "shift_rad": list(p.shift_rad),
                    "factor": list(p.factor),
                },
                "controller": {
                    "at_tip": int(p.at_tip),
                    "kp": list(p.kp),
                    "kd": list(p.kd),
                    "velocity_weight": weight,
                    "tick_s": p.tick_s,
                    "length": list(p.declared_lengths_m),
                },
                "effects": native(
                    p.effects or PlantEffects(),
                    present=p.effects is not None,
                    step_s=p.true_tick_s / SUBSTEPS,
                ),
                "step_s": p.true_tick_s / SUBSTEPS,
            },
        )
        self._remember(q_rad)
        lib.impid_plant_rest(self._plant, [float(q_rad[0]), float(q_rad[1])])

    def _remember(self, q_rad: Array) -> None:
        """A load with a delayed force has always rested where it is."""
        load = self._plant.effects.load
        if load.late_steps <= 0.0:
            return
        d = position(q_rad, self._lengths) - np.array(list(self._plant.load.x0))
        history = np.tile([*d, 0.0, 0.0], (int(load.late_steps) + 3, 1))
        self._history = ffi.new("double[]", history.ravel().tolist())  # the C structure only points to it
        load.history = self._history
        load.history_rows = history.shape[0]

    def settle(self, row: Array, ticks: int) -> Motion:
        """Holds one row of the reference for so long before time zero, as before a trial."""
        self._plant.effects.time_s = -ticks * SUBSTEPS * self._plant.step_s
        motion = self.run(np.tile(row, (ticks, 1)))
        self._plant.effects.time_s = 0.0
        return motion

    def set_speed(self, w: Array) -> None:
        """Sets the joint speeds, shape (2,), rad/s: a start from motion instead of rest."""
        self._plant.w = [float(w[0]), float(w[1])]

    def energy(self) -> float:
        """Kinetic energy of robot and payload plus that of the springs, J."""
        return float(lib.impid_plant_energy(self._plant))

    def run(self, reference: Array, inputs: Array | None = None) -> Motion:
        """Advances by one tick per row of the reference.

        Args:
            reference: q1, q2 (rad), w1, w2 (rad/s), shape (n, 4); for the controller at the end-effector
                x, y (m) and the force to add (N).
            inputs: torque on the joints (N m), push on the load's side (N), shift of the load's equilibrium
                (m), held over each tick, shape (n, 6); only looked at where there are effects.
        """
        if inputs is not None:
            inputs = np.ascontiguousarray(inputs, dtype=np.float64)
            assert inputs.shape == (reference.shape[0], INPUTS)
        reference = np.ascontiguousarray(reference, dtype=np.float64)
        ticks = reference.shape[0]
        fine = (SUBSTEPS * ticks, 2)
        motion = Motion(
            q=np.empty(fine),
            w=np.empty(fine),
            acceleration=np.empty(fine),
            force=np.empty(fine),
            crept=np.empty(fine),
            count=np.empty((ticks, 2), dtype=np.int32),
            torque=np.empty((ticks, 2)),
        )
        lib.impid_plant_run(
            self._plant,
            ticks,
            ffi.from_buffer("double[]", reference),
            ffi.NULL if inputs is None else ffi.from_buffer("double[]", inputs),
            *(
                _doubles(array)
                for array in (motion.q, motion.w, motion.acceleration, motion.force, motion.crept)
            ),
            ffi.from_buffer("int32_t[]", motion.count, require_writable=True),
            _doubles(motion.torque),
        )
        return motion


def _doubles(array: Array) -> Any:
    return ffi.from_buffer("double[]", array, require_writable=True)
