"""One trial as the sensor board and the robot's log see it: plant, sensors and clocks put together.

The plant runs on the robot controller's ticks, the board converts on its own. The board's clock rules the
calls: for a stretch of board ticks the world runs the plant as far as that needs and gives what converters
and counters read. Rows of the robot's log come out on the side.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hil_sim.plant.kinematics import joints_of, links_of
from hil_sim.plant.plant import SUBSTEPS, Motion, Plant, PlantParameters
from hil_sim.plant.reference import Course
from hil_sim.seeds import generator
from hil_sim.sensors import adxl355
from hil_sim.sensors.accelerometer import STANDARD_GRAVITY, AccelerometerTruth, Output, OutputFilter
from hil_sim.sensors.adc import CONVERSIONS, AnalogInput
from hil_sim.sensors.clock import Clock
from hil_sim.sensors.encoder import EncoderTruth
from hil_sim.sensors.force_sensor import ForceSensor, ForceSensorTruth
from hil_sim.sensors.torque_log import LogRows, LogTruth, TorqueLog

Array = NDArray[np.float64]
TICK_US = 1000  # of the board
CONVERSION_US = TICK_US // CONVERSIONS
SETTLE_TICKS = 2000


@dataclass(frozen=True)
class TrialTruth:
    """Everything that is true of one trial; the host never sees it.

    Attributes:
        name: of the trial; with the seed it names the streams of chance.
        plant: robot, load and controller.
        course: what the controller follows.
        inputs: torques, pushes and shifts that time alone decides, one row per tick; see Plant.run. None:
            there are none.
        accelerometer, encoder, force_sensor: the sensors; force_sensor is None where there is none.
        part: of the accelerometer; all but the ADXL355 have two analog outputs.
        board_factor: true angle over the one that setup.toml lets expect of the board's counters, beyond the
            encoder's own factor.
        accelerometer_delay_s: the acceleration is that of so long ago.
        vref_V: true reference of the converter.
        adc_noise_lsb: its own noise, rms, ahead of rounding.
        miscounts_per_min, miscount: how often noise on the lines shifts a counter of the board, and by how
        much.
        log: how the robot's log errs.
        robot_clock: shows its zero when the motion starts.
        board_rate_ppm: rate of the board's clock.
        duration_s: of the log, on the robot's clock.
        seed: of all chance.
    """

    name: str
    plant: PlantParameters
    course: Course
    inputs: Array | None
    accelerometer: AccelerometerTruth
    encoder: EncoderTruth
    force_sensor: ForceSensorTruth | None
    accelerometer_delay_s: float
    vref_V: float
    adc_noise_lsb: float
    miscounts_per_min: float
    miscount: int
    log: LogTruth
    robot_clock: Clock
    board_rate_ppm: float
    duration_s: float
    seed: int
    board_factor: tuple[float, float] = (1.0, 1.0)
    part: str = "ADXL203"


@dataclass(frozen=True)
class Readings:
    """What the board reads in n of its ticks.

    Attributes:
        adc: 12-bit codes, both axes, shape (n, 8, 2); of a digital sensor 20-bit codes, shape (n, 1, 3).
        encoder: counters, shape (n, 2).
    """

    adc: NDArray[np.uint16] | NDArray[np.uint32]
    encoder: NDArray[np.int32]


def converter(truth: TrialTruth, upright_g: float) -> AnalogInput | adxl355.DigitalOutput:
    """What makes readings of the accelerometer's outputs; upright_g: felt across the plane, at rest."""
    noise = generator(truth.seed, truth.name, "converter noise")
    if truth.part == adxl355.PART:
        return adxl355.DigitalOutput(upright_g, truth.accelerometer.noise_density_ug_per_rtHz, noise)
    return AnalogInput(truth.vref_V, truth.adc_noise_lsb, noise)


class World:
    """Robot, load and sensors of one trial. Rests until `begin`, then moves for ever."""

    def __init__(self, truth: TrialTruth) -> None:
        self.truth = truth
        tick_s = truth.plant.tick_s
        self._relative = truth.plant.relative
        q = links_of(truth.encoder.place_of(truth.course.start_rad), relative=self._relative)
        beyond = zip(truth.encoder.factor, truth.board_factor, strict=True)
        first, second = (one * more for one, more in beyond)
        self._board_encoder = replace(truth.encoder, factor=(first, second))
        self._step_s = truth.plant.true_tick_s / SUBSTEPS
        self._plant = Plant(truth.plant, q)
        self._course = truth.course.ticked(tick_s)
        self._filter = OutputFilter(truth.accelerometer, self._step_s)
        self._output = Output(
            truth.accelerometer,
            1e-6 * CONVERSION_US,
            generator(truth.seed, truth.name, "accelerometer noise"),
        )
        sensor = truth.force_sensor
        in_plane_g = np.hypot(*truth.accelerometer.gravity_m_s2) / STANDARD_GRAVITY
        self._converter = converter(truth, float(np.sqrt(max(0.0, 1.0 - in_plane_g**2))))
        self._lines = generator(truth.seed, truth.name, "encoder lines")
        self._shift = np.zeros(2, dtype=np.int32)  # of the board's counters, by what noise made them count
        self._log = TorqueLog(
            truth.log,
            zero_s=truth.robot_clock.zero_s,
            tick_s=tick_s,
            ticks=round(truth.duration_s / tick_s),
            encoder=truth.encoder,
            relative=truth.plant.relative,
            force_sensor=None
            if sensor is None
            else ForceSensor(
                sensor,
                1.0 / (truth.log.every_ticks * tick_s),
                generator(truth.seed, truth.name, "force sensor noise"),
            ),
            generators=(
                generator(truth.seed, truth.name, "torque noise"),
                generator(truth.seed, truth.name, "log"),
            ),
        )
        self._rows: list[LogRows] = []
        self._tick = 0  # ticks of the controller so far
        self._board_clock = Clock(0.0, truth.board_rate_ppm)
        self._begin_us: int | None = None
        # The sensor's lateness in steps of the plant.
        self._late = truth.accelerometer_delay_s / self._step_s
        # What the interpolation still needs, from grid point _from on: q, w and filter output at grid points;
        # the drive of the filter over the substep that begins there (one row fewer).
        self._from = 0
        self._q = q[None, :].copy()
        self._w = np.zeros((1, 2))
        self._crept = np.zeros((1, 2))
        if truth.plant.effects is not None:
            # Springs and gravity are held in balance before the trial, not from its first instant on.
            held = self._plant.settle(self._course.ticks(0, 1)[0] * [1.0, 1.0, 0.0, 0.0], SETTLE_TICKS)
            self._q, self._w = held.q[-1:].copy(), held.w[-1:].copy()
            self._crept = held.crept[-1:].copy()
            self._log.held_before(held)
        self._filtered = self._filter.rest(self._q[0])[None]
        self._drive = np.zeros((0, 2))

    @property
    def begin_us(self) -> int | None:
        """Board time at which the motion started; None before."""
        return self._begin_us

    @property
    def log_complete(self) -> bool:
        """The robot's log of the trial has all its rows."""
        return self._log.complete

    def begin(self, board_us: int) -> None:
        """Starts the motion when the board's clock shows board_us; must lie ahead of what was read."""
        self._begin_us = board_us

    def board_restarted(self, before_us: int, after_us: int) -> None:
        """The board's clock jumped from before_us to after_us; the motion goes on."""
        if self._begin_us is not None:
            self._begin_us += after_us - before_us

    def read(self, first_us: int, ticks: int, *, self_test: bool = False) -> Readings:
        """What the board reads in consecutive ticks, the first of them at board time first_us."""
        if self._begin_us is None:
            at = joints_of(self._q[:1], relative=self._relative) + self._crept[:1]
            count = self._board_encoder.count(np.repeat(at, ticks, axis=0))
            # Rest, or nearly: the plane may be inclined.
            filtered = np.repeat(self._filtered[:1], ticks * CONVERSIONS, axis=0)
        else:
            since_us = (first_us - self._begin_us) + TICK_US * np.arange(ticks)
            conversion_us = since_us[:, None] + CONVERSION_US * (np.arange(CONVERSIONS) - (CONVERSIONS - 1))
            place = self._place(1e-6 * conversion_us.ravel().astype(np.float64))
            felt = np.maximum(place - self._late, 0.0)
            self._advance_past(float(max(place[-1], felt[-1])))
            filtered = self._filtered_at(felt)
            count = self._board_encoder.count(self._seen_at(place[CONVERSIONS - 1 :: CONVERSIONS]))
            self._forget(float(min(place[-1], felt[-1])))
        count = count + self._miscounted(ticks)
        volts = self._output.volts(filtered, self_test=self_test)
        return Readings(adc=self._converter.readings(volts, self_test=self_test), encoder=count)

    def _place(self, since_s: Array) -> Array:
        """Substeps since the start at which the board's clock has advanced by since_s beyond the start.

        The plant's steps are those of the robot's clock. Where that clock drifts, the steps drift against
        the board; that they then also last some ppm longer is nothing that the motion would show.
        """
        true_s = self._board_clock.true_time(since_s)
        robot = self.truth.robot_clock
        if not robot.steady:
            true_s = true_s + robot.ahead(true_s) / robot.rate
        return np.asarray(np.maximum(true_s / self._step_s, 0.0))

    def _miscounted(self, ticks: int) -> NDArray[np.int32]:
        """What noise on the lines has added to the board's counters by each tick."""
        truth = self.truth
        if truth.miscounts_per_min <= 0.0:
            return np.zeros((1, 2), dtype=np.int32)
        hits = self._lines.random((ticks, 2)) < truth.miscounts_per_min * 1e-6 * TICK_US / 60.0
        signs = np.where(self._lines.random((ticks, 2)) < 0.5, -1, 1)
        shift = self._shift + np.cumsum(truth.miscount * signs * hits, axis=0).astype(np.int32)
        self._shift = shift[-1]
        return np.asarray(shift, dtype=np.int32)

    def take_log(self) -> list[LogRows]:
        """The rows that have come up since the last call, in order."""
        rows, self._rows = self._rows, []
        return rows

    def _advance_past(self, place: float) -> None:
        """Runs the plant until the grid reaches beyond `place` substeps since the start."""
        missing = int(place) + 1 - SUBSTEPS * self._tick
        if missing <= 0:
            return
        ticks = -(-missing // SUBSTEPS)
        reference = self._course.ticks(self._tick, ticks)
        motion = self._plant.run(reference, self._inputs(ticks))
        self._tick += ticks
        if not self._log.complete:
            self._rows.append(self._log.add(motion, reference[:, 2:]))
        self._append(motion)

    def _inputs(self, ticks: int) -> Array | None:
        """The next rows; nothing is done from outside once the trial is over."""
        if self.truth.inputs is None:
            return None
        rows = self.truth.inputs[self._tick : self._tick + ticks]
        return np.pad(rows, ((0, ticks - rows.shape[0]), (0, 0)))

    def _append(self, motion: Motion) -> None:
        q = np.concatenate([self._q[-1:], motion.q])
        w = np.concatenate([self._w[-1:], motion.w])
        drive, filtered = self._filter.drive(q, motion.acceleration, w)
        self._q = np.concatenate([self._q, motion.q])
        self._w = np.concatenate([self._w, motion.w])
        self._crept = np.concatenate([self._crept, motion.crept])
        self._filtered = np.concatenate([self._filtered, filtered])
        self._drive = np.concatenate([self._drive, drive])

    def _filtered_at(self, place: Array) -> Array:
        """Output of the accelerometer's filter between grid points: it nears the drive of that substep."""
        whole = place.astype(np.int64)
        index = whole - self._from
        decay = np.exp((whole - place) * (self._step_s * self._filter.rate))
        drive = self._drive[index]
        return drive + (self._filtered[index] - drive) * decay[:, None]

    def _seen_at(self, place: Array) -> Array:
        """What the encoders turn by between grid points, rad: the joints, and what they run ahead by."""
        whole = place.astype(np.int64)
        index, u = whole - self._from, (place - whole)[:, None]
        crept = self._crept[index] + u * (self._crept[index + 1] - self._crept[index])
        return joints_of(self._q_at(place), relative=self._relative) + crept

    def _q_at(self, place: Array) -> Array:
        """Angles of the links between grid points: the cubic through angles and speeds at both ends."""
        whole = place.astype(np.int64)
        index = whole - self._from
        u = (place - whole)[:, None]
        q0, q1 = self._q[index], self._q[index + 1]
        w0, w1 = self._step_s * self._w[index], self._step_s * self._w[index + 1]
        rise = q1 - q0
        return q0 + u * (w0 + u * (3.0 * rise - 2.0 * w0 - w1 + u * (w0 + w1 - 2.0 * rise)))

    def _forget(self, place: float) -> None:
        """Drops what lies before the last conversion; the next one comes later."""
        gone = int(place) - self._from
        self._from += gone
        self._q = self._q[gone:]
        self._w = self._w[gone:]
        self._crept = self._crept[gone:]
        self._filtered = self._filtered[gone:]
        self._drive = self._drive[gone:]
