"""The serving loop: wall clock, client, board, world and faults, kept in step.

The robot rests until the board accepts START; a moment later the motion and the robot's log begin. A frame
from the client reaches the board at the board time at which its last bit would have come over the wire,
because clock synchronisation is measured with it.
"""

import os
import signal
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

from hil_sim.board import layout
from hil_sim.board.flash_file import open_flash
from hil_sim.board.make import maker
from hil_sim.board.native import TICK_US, BoardConfig, new_flash
from hil_sim.errors import SimError
from hil_sim.faults.injectors import BOOT_US, Rig
from hil_sim.faults.readings import FaultyReadings
from hil_sim.faults.schedule import Schedule
from hil_sim.faults.schema import RESTARTS
from hil_sim.scenarios.schema import Scenario, Trial
from hil_sim.sensors.clock import Clock
from hil_sim.serve.attachment import CAN_FRAMES_PER_MS, Parcel
from hil_sim.serve.connect import Connection, connect
from hil_sim.serve.events import say, warn
from hil_sim.serve.lag import LagMeter
from hil_sim.serve.pace import Pace
from hil_sim.serve.power import PoweredBoard
from hil_sim.serve.robot_log import LiveRobotLog
from hil_sim.serve.torque_stream import TorqueStream
from hil_sim.serve.truth_file import TruthFile
from hil_sim.serve.turntable import Turntable
from hil_sim.study.setup_file import write_setup
from hil_sim.trials import trial_truth
from hil_sim.world import World

FIRST_US = 1_000_000  # what the board's clock shows when the port is ready
LEAD_US = 250_000  # from START to the motion
BLOCK_WALL_S = 4e-3  # the loop's period while nobody writes
ATTENTION_TICKS = 10  # after a frame from the client: tick by tick, so that answers leave in time
CATCH_UP_TICKS = 100  # handed out at once when the machine was busy
ON_THE_WIRE_US = 100_000  # a client that writes faster than the wire carries has to wait


@dataclass(frozen=True)
class ServeOptions:
    """What the command line chose; paths are None where nothing is to be written."""

    seed: int
    speed: float
    connection: Connection
    robot_log: Path | None
    setup_file: Path | None
    truth_file: Path | None
    flash_file: Path | None = None
    tumble_positions: int | None = None  # on a dividing head instead of the robot
    torques_to: str | None = None  # where each row of the log goes at once, HOST:PORT
    binary: Path | None = None  # an ELF file to run in the emulator instead of the native core


def serve(scenario: Scenario, trial: Trial, options: ServeOptions) -> None:
    """Serves one trial until it is over and the client has gone, or until SIGTERM or SIGINT.

    Raises:
        SimError: a file cannot be written where it was asked for, or the carrier or a fault of the scenario
            cannot be had here.
    """
    try:
        session = _Session(scenario, trial, options)
        try:
            session.run()
        finally:
            session.close()
    except OSError as error:
        if error.filename is None:
            raise
        raise SimError(f"{error.filename}: {error.strerror}; name a place that can be written to") from None


class _Session:
    def __init__(self, scenario: Scenario, trial: Trial, options: ServeOptions) -> None:
        self._trial, self._options = trial, options
        if scenario.setup.robot.single:
            raise SimError(f"{scenario.setup.robot.model} has no board to serve: use impid-sim study")
        truth = trial_truth(scenario, trial, options.seed)
        self._world = World(truth)
        positions = options.tumble_positions
        self._turntable = None if positions is None else Turntable(truth, positions)
        path = options.robot_log
        with_force = scenario.world.force_sensor is not None
        self._log = (
            None
            if path is None
            else LiveRobotLog(path, with_force=with_force, with_command=trial.kind == "stochastic")
        )
        self._stream = None if options.torques_to is None else TorqueStream(options.torques_to)
        bytes_per_ms = scenario.world.serial.bytes_per_ms
        self._power = PoweredBoard(
            BoardConfig(
                start_us=FIRST_US,
                serial_bytes_per_ms=bytes_per_ms,
                can_frames_per_ms=CAN_FRAMES_PER_MS,
                part=scenario.setup.accelerometer.part,
                flash=new_flash() if options.flash_file is None else open_flash(options.flash_file),
            ),
            maker(options.binary),
        )
        self._readings = FaultyReadings()
        if options.binary is not None and options.flash_file is not None:
            raise SimError("--flash: the emulated chip keeps its own flash; leave --elf or --flash away")
        restarts = [fault.kind for fault in scenario.faults if isinstance(fault, RESTARTS)]
        if options.binary is not None and restarts:
            raise SimError(f"fault {restarts[0]}: the emulated chip has no such input; leave --elf away")
        if options.setup_file is not None:
            write_setup(scenario, options.setup_file)
        self._wire = connect(options.connection, bytes_per_ms, lambda: self._power.board.now_us)
        try:
            self._faults = Schedule(
                scenario.faults,
                trial.name,
                options.seed,
                Rig(
                    self._wire.cable, self._wire.line, self._wire.bus, self._readings, self._power, self._log
                ),
            )
        except SimError:
            self._wire.cable.close()
            raise
        self._truth = TruthFile(options.truth_file, scenario, trial, options.seed)
        rate = Clock(0.0, scenario.world.clocks.board_ppm).rate
        self._pace = Pace(FIRST_US, options.speed, rate)
        self._block_us = TICK_US * max(1, round(BLOCK_WALL_S * options.speed * 1e6 / TICK_US))
        layout.database()  # another tenth of a second: now, not at the first command
        self._inbound: deque[tuple[int, Parcel]] = deque()  # when its last bit arrives, board time
        self._attention_until_us = 0
        self._lag = LagMeter()
        self._turned_s = time.monotonic()
        self._stop = False
        self._finished = False

    def close(self) -> None:
        """Takes the carrier down."""
        self._wire.cable.close()
        if self._stream is not None:
            self._stream.close()

    def run(self) -> None:
        """Runs until there is nothing left to do."""
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._on_signal)
        say(
            event="ready",
            carrier=self._options.connection.carrier,
            **self._wire.ready(),
            link=_text(self._options.connection.link),
            robot_log=_text(self._options.robot_log),
            setup=_text(self._options.setup_file),
            trial=self._trial.name,
            kind=self._trial.kind,
            duration_s=self._trial.duration_s,
            speed=self._options.speed,
            pid=os.getpid(),
        )
        self._pace.set(self._power.board.next_tick_us)
        while not self._stop and not self._nothing_left():
            self._turn()
        self._conclude()

    def _nothing_left(self) -> bool:
        return self._finished and not self._wire.cable.connected and not self._faults.cable_is_out

    def _conclude(self) -> None:
        rows = 0
        if self._log is not None:
            self._log.finish()
            rows = self._log.rows
        if not self._finished:
            say(event="stopped", trial=self._trial.name, robot_log_rows=rows)
        self._truth.write(self._faults.close())
        dropped = self._wire.cable.dropped
        if dropped:
            unit = "bytes" if self._wire.bus is None or self._wire.line is not None else "frames"
            warn(f"{dropped} {unit} lost because the client did not read them")
        say(
            event="closed",
            boots=self._truth.boots(),
            dropped=dropped,
            faults=self._faults.records,
            lag=self._lag.report(),
        )

    def _turn(self) -> None:
        """Once around: wait, take what the client sent, and let the board come up to now."""
        wait_s = self._pace.seconds_until(self._due_us())
        if self._inbound and self._inbound[-1][0] > self._pace.now_us() + ON_THE_WIRE_US:
            time.sleep(wait_s)
            parcels: list[Parcel] = []
        else:
            parcels = self._wire.receive(wait_s)
        self._keep_pace()
        now_us = self._pace.now_us()
        for parcel in parcels:
            begin_us = max(now_us, self._inbound[-1][0]) if self._inbound else now_us
            self._inbound.append((begin_us + self._wire.transit_us(parcel), parcel))
        if parcels:
            self._attention_until_us = now_us + ATTENTION_TICKS * TICK_US
        self._come_up()
        self._reset_if_asked()

    def _due_us(self) -> int:
        """When the loop has to look at the board again."""
        board = self._power.board
        attentive = board.next_tick_us < self._attention_until_us
        due_us = board.next_tick_us + (0 if attentive else self._block_us - TICK_US)
        if attentive and board.lines_idle_us > board.now_us:
            due_us = min(due_us, board.lines_idle_us)
        if self._inbound:
            due_us = min(due_us, self._inbound[0][0])
        return due_us

    def _come_up(self) -> None:
        """Everything happens that is due by now, in its order."""
        while not self._stop:
            now_us = self._pace.now_us()
            fault_us = self._next_fault_us()
            arrival_us = self._inbound[0][0] if self._inbound else None
            if fault_us is not None and fault_us <= min(now_us, now_us if arrival_us is None else arrival_us):
                self._run_ticks(fault_us - 1)
                self._advance(fault_us)
                self._switch_fault(fault_us)
            elif arrival_us is not None and arrival_us <= now_us:
                self._run_ticks(arrival_us)
                self._arrive(*self._inbound.popleft())
            else:
                self._run_ticks(now_us)
                self._advance(now_us)
                return

    def _run_ticks(self, until_us: int) -> None:
        """All ticks up to until_us."""
        board = self._power.board
        while (ticks := (until_us - board.next_tick_us) // TICK_US + 1) > 0 and not self._stop:
            ticks = self._power.before_ticks(min(ticks, CATCH_UP_TICKS))
            truth = self._world.read(board.next_tick_us, ticks, self_test=board.self_test_pin)
            if self._turntable is not None:
                truth = self._turntable(truth, streaming=bool(board.streaming), self_test=board.self_test_pin)
            readings, flags = self._readings(truth)
            if board.streaming:
                self._truth.sampled(ticks)
            board.run(readings.adc, readings.encoder, flags)
            self._hand_out()
            self._write_log()

    def _advance(self, now_us: int) -> None:
        """The lines carry on between ticks."""
        if now_us > self._power.board.now_us:
            self._power.board.advance(now_us)
        self._hand_out()

    def _arrive(self, at_us: int, parcel: Parcel) -> None:
        board = self._power.board
        if at_us < 0:  # the board is off
            return
        self._wire.deliver(board, parcel, at_us)
        self._reset_if_asked()

    def _reset_if_asked(self) -> None:
        board = self._power.board
        if board.reset_requested:
            self._advance(board.lines_idle_us)  # the answer leaves first
            self._power.at_us = board.now_us
            self._power.restart("SOFTWARE", BOOT_US)
            self._book_boot()

    def _hand_out(self) -> None:
        sent = self._wire.hand_out(self._power.board)
        self._truth.count(sent.samples)
        if sent.started and self._world.begin_us is None:
            self._world.begin(self._power.board.next_tick_us + LEAD_US)
            self._truth.begin(self._world.begin_us)
            self._truth.write(self._faults.records)

    def _next_fault_us(self) -> int | None:
        begin_us, since_us = self._world.begin_us, self._faults.next_since_us
        return None if begin_us is None or since_us is None else begin_us + since_us

    def _switch_fault(self, at_us: int) -> None:
        self._power.at_us = at_us
        event = self._faults.step(at_us if at_us >= 0 else None, self._power.boot_id)
        if event["kind"] == "cable_pulled" and event["phase"] == "end":
            event |= self._wire.ready()
        say(**event)
        self._book_boot()
        self._truth.write(self._faults.records)

    def _book_boot(self) -> None:
        """Everything that counts on the board's clock follows it to its new zero."""
        boot = self._power.take_new_boot()
        if boot is None:
            return
        shift_us = boot.shift_us
        self._world.board_restarted(0, shift_us)
        self._pace.shift(shift_us)
        self._readings.board_restarted()
        self._wire.board_restarted()
        self._inbound = deque((due_us + shift_us, parcel) for due_us, parcel in self._inbound)
        self._attention_until_us = 0
        self._truth.boot(boot.boot_id, boot.reset_cause, self._world.begin_us)
        say(event="boot", boot_id=boot.boot_id, reset_cause=boot.reset_cause)

    def _write_log(self) -> None:
        rows = self._world.take_log()
        if self._stream is not None and rows:
            self._stream.send(rows)
        if self._log is not None:
            self._log.add(rows)
        if self._world.log_complete and not self._finished:
            self._finished = True
            if self._log is not None:
                self._log.finish()
            say(
                event="trial-finished",
                trial=self._trial.name,
                robot_log=_text(self._options.robot_log),
                robot_log_rows=self._log.rows if self._log else 0,
            )

    def _keep_pace(self) -> None:
        """Books how far the board is behind; says so, and gives up what cannot be caught up with."""
        now_s = time.monotonic()
        behind_us = self._pace.now_us() - self._power.board.next_tick_us - self._block_us
        behind_s = 1e-6 * behind_us / self._options.speed
        give_up_s = self._lag.observe(behind_s, now_s - self._turned_s)
        self._turned_s = now_s
        if self._lag.complaint_is_due(behind_s, now_s):
            warn(f"{behind_s:.2f} s behind; lower --speed or free the machine")
            say(event="lag", now_s=round(behind_s, 3), **self._lag.report())
        if give_up_s > 0.0:
            self._pace.shift(-int(1e6 * give_up_s * self._options.speed))

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        self._stop = True


def _text(path: Path | None) -> str | None:
    return None if path is None else str(path)
