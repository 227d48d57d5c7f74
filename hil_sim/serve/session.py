"""The serving loop: wall clock, client, board and world, kept in step.

The robot rests until the board accepts START; a moment later the motion and the robot's log begin. Bytes from
the client reach the board at the board time of their arrival, because clock synchronisation is measured with
them.
"""

import json
import os
import signal
import sys
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

from hil_sim.board import layout
from hil_sim.board.native import TICK_US, BoardConfig, NativeBoard
from hil_sim.board.wire import FrameReader, accepts_start
from hil_sim.carriers.protocol import Carrier
from hil_sim.carriers.pty import PtyCarrier
from hil_sim.errors import SimError
from hil_sim.scenarios.schema import Scenario, Trial
from hil_sim.sensors.clock import Clock
from hil_sim.serve.pace import Pace
from hil_sim.serve.robot_log import LiveRobotLog
from hil_sim.study.setup_file import write_setup
from hil_sim.trials import trial_truth
from hil_sim.truth import scenario_json
from hil_sim.world import World

FIRST_US = 1_000_000  # what the board's clock shows when the port is ready
LEAD_US = 250_000  # from START to the motion
BLOCK_WALL_S = 4e-3  # the loop's period while nobody writes
ATTENTION_TICKS = 10  # after a byte from the client: tick by tick, so that answers leave in time
CATCH_UP_TICKS = 100  # at most so many before the client is served again
LAG_US = 100_000  # behind by more than this (wall time): say so
SOFTWARE_RESET = 3  # STATUS_HEALTH.reset_cause


@dataclass(frozen=True)
class ServeOptions:
    """What the command line chose; paths are None where nothing is to be written."""

    seed: int
    speed: float
    robot_log: Path | None
    link: Path | None
    setup_file: Path | None
    truth_file: Path | None


def serve(scenario: Scenario, trial: Trial, options: ServeOptions) -> None:
    """Serves one trial until it is over and the client has gone, or until SIGTERM or SIGINT.

    Raises:
        SimError: a file cannot be written where it was asked for.
    """
    carrier = PtyCarrier()
    try:
        session = _Session(scenario, trial, options, carrier)
        if options.setup_file is not None:
            write_setup(scenario, options.setup_file)
        if options.link is not None:
            _point(options.link, carrier.address)
        session.run()
    except OSError as error:
        if error.filename is None:
            raise
        raise SimError(f"{error.filename}: {error.strerror}; name a place that can be written to") from None
    finally:
        if options.link is not None and options.link.is_symlink():
            options.link.unlink()
        carrier.close()


class _Session:
    def __init__(self, scenario: Scenario, trial: Trial, options: ServeOptions, carrier: Carrier) -> None:
        self._scenario, self._trial, self._options, self._carrier = scenario, trial, options, carrier
        self._world = World(trial_truth(scenario, trial, options.seed))
        with_force = scenario.world.force_sensor is not None
        path = options.robot_log
        self._log = None if path is None else LiveRobotLog(path, with_force=with_force)
        self._config = BoardConfig(start_us=FIRST_US, serial_bytes_per_ms=scenario.world.serial.bytes_per_ms)
        self._board = NativeBoard(self._config)
        self._answers: FrameReader | None = FrameReader()  # until START was accepted
        rate = Clock(0.0, scenario.world.clocks.board_ppm).rate
        self._pace = Pace(FIRST_US, options.speed, rate)
        self._block = max(1, round(BLOCK_WALL_S * options.speed * 1e6 / TICK_US))
        layout.database()  # another tenth of a second: now, not at the first command
        self._attention_until_us = 0
        self._complaint_us = 0
        self._stop = False
        self._finished = False

    def run(self) -> None:
        """Runs until there is nothing left to do."""
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._on_signal)
        self._say(
            event="ready",
            port=self._carrier.address,
            link=_text(self._options.link),
            robot_log=_text(self._options.robot_log),
            setup=_text(self._options.setup_file),
            trial=self._trial.name,
            kind=self._trial.kind,
            duration_s=self._trial.duration_s,
            speed=self._options.speed,
            pid=os.getpid(),
        )
        self._pace.set(self._board.next_tick_us)
        while not self._stop and not (self._finished and not self._carrier.connected):
            self._turn()
        if self._log is not None:
            self._log.finish()
        if not self._finished:
            self._say(
                event="stopped", trial=self._trial.name, robot_log_rows=self._log.rows if self._log else 0
            )
        if self._carrier.dropped:
            print(  # noqa: T201
                f"impid-sim: {self._carrier.dropped} bytes lost because the client did not read them",
                file=sys.stderr,
            )

    def _turn(self) -> None:
        """Once around: wait, run the ticks that are due, hand bytes both ways."""
        attentive = self._board.next_tick_us < self._attention_until_us
        due_us = self._board.next_tick_us + (0 if attentive else (self._block - 1) * TICK_US)
        data = self._carrier.receive(self._pace.seconds_until(due_us))
        now_us = self._pace.now_us()
        self._run_until(now_us)
        if data:
            self._board.serial_receive(data, max(now_us, self._board.next_tick_us - TICK_US))
            self._attention_until_us = self._board.next_tick_us + ATTENTION_TICKS * TICK_US
        self._hand_out()
        if self._board.reset_requested:
            self._reboot()

    def _run_until(self, now_us: int) -> None:
        while (ticks := (now_us - self._board.next_tick_us) // TICK_US + 1) > 0 and not self._stop:
            self._complain(now_us - self._board.next_tick_us - self._block * TICK_US)
            ticks = min(ticks, CATCH_UP_TICKS)
            readings = self._world.read(self._board.next_tick_us, ticks, self_test=self._board.self_test_pin)
            self._board.run(readings.adc, readings.encoder)
            self._hand_out()
            self._write_log()

    def _hand_out(self) -> None:
        sent = self._board.serial_take()
        self._board.can_take()  # no bus is attached
        if not sent:
            return
        self._carrier.send(sent)
        if self._answers is not None and any(accepts_start(frame) for frame in self._answers.feed(sent)):
            self._answers = None
            self._begin()

    def _begin(self) -> None:
        begin_us = self._board.next_tick_us + LEAD_US
        self._world.begin(begin_us)
        if self._options.truth_file is not None:
            truth = scenario_json(
                self._scenario, self._options.seed, {self._trial.name: begin_us}, (self._trial,)
            )
            self._options.truth_file.write_text(json.dumps(truth, indent=2) + "\n", encoding="utf-8")

    def _write_log(self) -> None:
        rows = self._world.take_log()
        if self._log is not None:
            self._log.add(rows)
        if self._world.log_complete and not self._finished:
            self._finished = True
            if self._log is not None:
                self._log.finish()
            self._say(
                event="trial-finished",
                trial=self._trial.name,
                robot_log=_text(self._options.robot_log),
                robot_log_rows=self._log.rows if self._log else 0,
            )

    def _reboot(self) -> None:
        before_us = self._board.next_tick_us
        self._board.close()
        self._config = BoardConfig(
            boot_id=self._config.boot_id + 1,
            reset_cause=SOFTWARE_RESET,
            serial_bytes_per_ms=self._config.serial_bytes_per_ms,
        )
        self._board = NativeBoard(self._config)
        self._attention_until_us = self._complaint_us = 0
        self._world.board_restarted(before_us, self._board.next_tick_us)
        self._pace.set(self._board.next_tick_us)

    def _complain(self, behind_us: int) -> None:
        """Says on stderr, at most every five seconds, that the machine cannot keep pace."""
        behind_wall_us = behind_us / self._options.speed
        if behind_wall_us > LAG_US and self._board.next_tick_us >= self._complaint_us:
            self._complaint_us = self._board.next_tick_us + int(5e6 * self._options.speed)
            print(  # noqa: T201
                f"impid-sim: {1e-6 * behind_wall_us:.2f} s behind; lower --speed or free the machine",
                file=sys.stderr,
                flush=True,
            )

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        self._stop = True

    @staticmethod
    def _say(**content: Any) -> None:
        try:
            print(json.dumps(content), flush=True)  # noqa: T201
        except BrokenPipeError:
            # Whoever listened has gone; the board does not depend on it.
            sys.stdout = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115


def _point(link: Path, target: str) -> None:
    if link.is_symlink():
        link.unlink()
    elif link.exists():
        raise SimError(f"{link}: exists and is no link; name another place for --link")
    link.symlink_to(target)


def _text(path: Path | None) -> str | None:
    return None if path is None else str(path)
