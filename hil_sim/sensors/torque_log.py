"""The robot controller's own log, one row per tick on its own clock."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil_sim.plant.plant import SUBSTEPS, Motion
from hil_sim.sensors.encoder import EncoderTruth
from hil_sim.sensors.force_sensor import ForceSensor

Array = NDArray[np.float64]
HALF = SUBSTEPS // 2


@dataclass(frozen=True)
class LogRows:
    """Consecutive rows of robot.csv, n of them.

    Attributes:
        t_s: robot clock, shape (n,).
        theta_rad: shape (n, 2).
        tau_Nm: mean joint torque over the sample period centred on t, shape (n, 2).
        force_N: of the load on the robot, shape (n, 2); None without a force sensor.
    """

    t_s: Array
    theta_rad: Array
    tau_Nm: Array
    force_N: Array | None


def joined(parts: list[LogRows]) -> LogRows:
    """One stretch of rows from several, in order; there must be at least one."""
    forces = [part.force_N for part in parts if part.force_N is not None]
    return LogRows(
        t_s=np.concatenate([part.t_s for part in parts]),
        theta_rad=np.concatenate([part.theta_rad for part in parts]),
        tau_Nm=np.concatenate([part.tau_Nm for part in parts]),
        force_N=np.concatenate(forces) if forces else None,
    )


class TorqueLog:
    """Turns stretches of motion into rows, up to the trial's end.

    A row covers half a tick before its instant and half a tick after, so the end of each stretch is kept.
    """

    def __init__(
        self,
        *,
        zero_s: float,
        tick_s: float,
        rows: int,
        encoder: EncoderTruth,
        force_sensor: ForceSensor | None,
    ) -> None:
        """rows: how many the trial has. zero_s: the robot's clock at the first."""
        self._zero_s = zero_s
        self._tick_s = tick_s
        self._rows = rows
        self._encoder = encoder
        self._force_sensor = force_sensor
        self._next = 0
        self._torque_before = np.zeros((1, 2))
        self._force_before = np.zeros((HALF, 2))

    @property
    def complete(self) -> bool:
        """All rows of the trial have come out."""
        return self._next >= self._rows

    def add(self, motion: Motion) -> LogRows:
        """The rows of the ticks in this stretch."""
        ticks = min(motion.torque.shape[0], self._rows - self._next)
        # Tick i lies between the torque held before it and the one held after it.
        torque = np.concatenate([self._torque_before, motion.torque])
        force = np.concatenate([self._force_before, motion.force])
        rows = LogRows(
            t_s=np.round(self._zero_s + (self._next + np.arange(ticks)) * self._tick_s, 9),
            theta_rad=self._encoder.angle(motion.count[:ticks]),
            tau_Nm=0.5 * (torque[:-1] + torque[1:])[:ticks],
            force_N=self._force(force[: SUBSTEPS * ticks]),
        )
        self._torque_before = motion.torque[-1:]
        self._force_before = motion.force[-HALF:]
        self._next += ticks
        return rows

    def _force(self, force: Array) -> Array | None:
        if self._force_sensor is None:
            return None
        centred = force.reshape(-1, SUBSTEPS, 2).mean(axis=1)
        return self._force_sensor.read(centred)
