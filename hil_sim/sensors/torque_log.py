"""The robot controller's own log on its own clock, with what such logs suffer from."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil_sim.plant.plant import SUBSTEPS, Motion
from hil_sim.sensors.encoder import EncoderTruth
from hil_sim.sensors.force_sensor import ForceSensor
from hil_sim.sensors.noise import Noise, NoiseTruth

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LogTruth:
    """How the log errs, and what it contains.

    Attributes:
        every_ticks: one row for so many ticks of the controller.
        delay_s: the logged torque is that of so long ago, per joint; negative: early.
        noise: of the torque; they add up.
        quantum_Nm: the torque comes in steps of this; 0: as a double.
        limit_Nm: the torque is clipped to this.
        stuck_every_s, stuck_s: now and then, at random, the torque column repeats its last value so long.
        jitter_s: standard deviation of how late a row's time stamp is.
        gap_every_s, gap_rows: now and then, at random, so many rows are missing.
        late_start_s: the log begins so long after the motion.
        with_command: the log has the commanded force.
    """

    every_ticks: int = 1
    delay_s: tuple[float, float] = (0.0, 0.0)
    noise: tuple[NoiseTruth, ...] = ()
    quantum_Nm: tuple[float, float] = (0.0, 0.0)
    limit_Nm: tuple[float, float] = (np.inf, np.inf)
    stuck_every_s: float = 0.0
    stuck_s: float = 0.0
    jitter_s: float = 0.0
    gap_every_s: float = 0.0
    gap_rows: int = 0
    late_start_s: float = 0.0
    with_command: bool = False


@dataclass(frozen=True)
class LogRows:
    """Consecutive rows of robot.csv, n of them.

    Attributes:
        t_s: robot clock, shape (n,).
        theta_rad: shape (n, 2).
        tau_Nm: mean joint torque over the sample period centred on t, shape (n, 2).
        force_N: of the load on the robot, shape (n, 2); None without a force sensor.
        command_N: commanded perturbation force, shape (n, 2); None where nothing is perturbed.
    """

    t_s: Array
    theta_rad: Array
    tau_Nm: Array
    force_N: Array | None
    command_N: Array | None = None


def joined(parts: list[LogRows]) -> LogRows:
    """One stretch of rows from several, in order; there must be at least one."""
    forces = [part.force_N for part in parts if part.force_N is not None]
    commands = [part.command_N for part in parts if part.command_N is not None]
    return LogRows(
        t_s=np.concatenate([part.t_s for part in parts]),
        theta_rad=np.concatenate([part.theta_rad for part in parts]),
        tau_Nm=np.concatenate([part.tau_Nm for part in parts]),
        force_N=np.concatenate(forces) if forces else None,
        command_N=np.concatenate(commands) if commands else None,
    )


class TorqueLog:
    """Turns stretches of motion into rows, up to the trial's end.

    A row covers half a period before its instant and half a period after, so it comes out once the motion
    has got so far.
    """

    def __init__(
        self,
        truth: LogTruth,
        *,
        zero_s: float,
        tick_s: float,
        ticks: int,
        encoder: EncoderTruth,
        relative: bool = False,
        force_sensor: ForceSensor | None,
        generators: tuple[np.random.Generator, np.random.Generator],
    ) -> None:
        """ticks: how long the trial is. zero_s: the robot's clock at its first tick. relative: see Plant.

        generators: of the noise, and of everything else.
        """
        every = truth.every_ticks
        self._truth = truth
        self._zero_s = zero_s
        self._tick_s = tick_s
        self._rows = -(-ticks // every)
        self._encoder = encoder
        self._relative = relative
        self._force_sensor = force_sensor
        # Each source of chance has its own stream, or the length of the blocks would decide who draws what.
        streams = generators[0].spawn(len(truth.noise))
        self._noise = [
            Noise(source, 1.0 / (every * tick_s), stream)
            for source, stream in zip(truth.noise, streams, strict=True)
        ]
        self._jitter, self._gaps, self._sticks = generators[1].spawn(3)
        self._late = np.array(truth.delay_s) / tick_s  # ticks
        self._force_late = 0.0 if force_sensor is None else force_sensor.delay_s / tick_s
        self._next = -(-round(truth.late_start_s / tick_s) // every)  # row
        self._missing = 0  # rows of the gap that are still to come
        self._stuck = 0
        self._held_value = np.zeros(2)
        # What is still needed, from tick _from on. Before the motion nothing exerts any torque.
        back = every + 1 + int(np.ceil(max(0.0, self._late.max(), self._force_late)))
        self._back = back
        self._from = -back
        self._torque = np.zeros((back, 2))
        self._speed = np.zeros((back, 2))
        self._force = np.zeros((back * SUBSTEPS, 2))
        self._count = np.zeros((back, 2), dtype=np.int32)
        self._command = np.zeros((back, 2))

    def held_before(self, motion: Motion) -> None:
        """What was held before the trial; without it the log takes it that nothing exerted any torque."""
        self._torque[:] = motion.torque[-1]
        self._force[:] = motion.force[-1]
        self._count[:] = motion.count[-1]

    @property
    def complete(self) -> bool:
        """All rows of the trial have come out."""
        return self._next >= self._rows

    def add(self, motion: Motion, command: Array) -> LogRows:
        """The rows that this stretch completes. command: force commanded at each tick, shape (n, 2), N."""
        self._torque = np.concatenate([self._torque, motion.torque])
        w = motion.w[::SUBSTEPS]
        speed = np.stack([w[:, 0], w[:, 1] - w[:, 0]], axis=1) if self._relative else w
        self._speed = np.concatenate([self._speed, speed])
        self._force = np.concatenate([self._force, motion.force])
        self._count = np.concatenate([self._count, motion.count])
        self._command = np.concatenate([self._command, command])
        every = self._truth.every_ticks
        known = self._from + self._torque.shape[0]
        last = (known - 0.5 * every + min(0.0, float(self._late.min()), self._force_late)) / every
        rows = np.arange(self._next, min(self._rows, int(np.floor(last)) + 1))
        result = self._rows_at(rows)
        self._next += rows.size
        gone = max(0, self._next * every - self._back - self._from)
        self._from += gone
        self._torque, self._count = self._torque[gone:], self._count[gone:]
        self._command, self._speed = self._command[gone:], self._speed[gone:]
        self._force = self._force[gone * SUBSTEPS :]
        return result

    def _rows_at(self, rows: NDArray[np.int64]) -> LogRows:
        truth, ticks = self._truth, rows * self._truth.every_ticks
        index = ticks - self._from
        tau = self._mean_torque(index)
        for noise in self._noise:
            tau = noise.add_to(tau, self._speed[index])
        tau = np.clip(tau, -np.array(truth.limit_Nm), np.array(truth.limit_Nm))
        for j, quantum in enumerate(truth.quantum_Nm):
            if quantum > 0.0:
                tau[:, j] = quantum * np.round(tau[:, j] / quantum)
        tau = self._sticking(tau)
        force = None
        if self._force_sensor is not None:
            force = self._force_sensor.read(self._mean_force(index), np.asarray(ticks * self._tick_s))
        late = truth.jitter_s * np.abs(self._jitter.standard_normal(rows.size))
        keep = self._present(rows.size)
        return LogRows(
            t_s=np.round(self._zero_s + ticks * self._tick_s + late, 9)[keep],
            theta_rad=self._encoder.angle(self._count[index])[keep],
            tau_Nm=tau[keep],
            force_N=None if force is None else force[keep],
            command_N=self._command[index][keep] if truth.with_command else None,
        )

    def _mean_torque(self, index: NDArray[np.int64]) -> Array:
        """Mean of the staircase over the period centred `delay` before each tick."""
        area = np.concatenate([np.zeros((1, 2)), np.cumsum(self._torque, axis=0)])
        knots = np.arange(area.shape[0])
        half = 0.5 * self._truth.every_ticks
        columns = []
        for j in (0, 1):
            centre = index - self._late[j]
            columns.append(
                np.interp(centre + half, knots, area[:, j]) - np.interp(centre - half, knots, area[:, j])
            )
        return np.stack(columns, axis=1) / self._truth.every_ticks

    def _mean_force(self, index: NDArray[np.int64]) -> Array:
        width = SUBSTEPS * self._truth.every_ticks
        area = np.concatenate([np.zeros((1, 2)), np.cumsum(self._force, axis=0)])
        if self._force_late:
            first = SUBSTEPS * (index - self._force_late) - width // 2
            knots = np.arange(area.shape[0])
            columns = [
                np.interp(first + width, knots, column) - np.interp(first, knots, column) for column in area.T
            ]
            return np.stack(columns, axis=1) / width
        start = SUBSTEPS * index - width // 2
        return np.asarray((area[start + width] - area[start]) / width)

    def _present(self, count: int) -> NDArray[np.bool_]:
        """Which rows made it into the file."""
        truth = self._truth
        keep = np.ones(count, dtype=np.bool_)
        if truth.gap_every_s <= 0.0:
            return keep
        chance = truth.every_ticks * self._tick_s / truth.gap_every_s
        starts = np.less(self._gaps.random(count), chance)
        for row in range(count):
            if starts[row] and self._missing == 0:
                self._missing = truth.gap_rows
            if self._missing:
                keep[row] = False
                self._missing -= 1
        return keep

    def _sticking(self, tau: Array) -> Array:
        truth = self._truth
        if truth.stuck_every_s <= 0.0:
            return tau
        row_s = truth.every_ticks * self._tick_s
        starts = np.less(self._sticks.random(tau.shape[0]), row_s / truth.stuck_every_s)
        for row in range(tau.shape[0]):
            if starts[row] and self._stuck == 0:
                self._stuck = round(truth.stuck_s / row_s)
            if self._stuck:
                tau[row] = self._held_value
                self._stuck -= 1
            self._held_value = tau[row].copy()
        return tau
