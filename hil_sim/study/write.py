"""A whole study in virtual time: nothing sleeps, every byte still comes from the firmware core."""

import json
from collections.abc import Iterator
from pathlib import Path

from hil_sim.board.make import BoardMaker, maker
from hil_sim.board.native import BoardConfig
from hil_sim.board.protocol import Board
from hil_sim.board.wire import FrameReader, Samples, accepts_start, command, samples
from hil_sim.errors import SimError
from hil_sim.scenarios.schema import Scenario, Trial
from hil_sim.sensors import adxl355
from hil_sim.study.setup_file import write_setup, write_trial
from hil_sim.study.tables import DeviceCsv, RobotCsv
from hil_sim.trials import trial_truth
from hil_sim.truth import scenario_json
from hil_sim.world import TICK_US, World

BLOCK_TICKS = 1000
LEAD_US = 250_000  # the recording runs before the motion starts
TAIL_TICKS = 250  # and goes on after the robot's log has ended
PAUSE_US = 10_000_000  # between two trials; the board's clock runs on
FIRST_US = 5_000_000  # from the board's boot to the first trial


def write_study(
    scenario: Scenario, out: Path, seed: int, truth_file: Path | None = None, binary: Path | None = None
) -> None:
    """Writes the study folder, and the truth to a file outside it.

    Args:
        scenario: what to simulate.
        out: the folder; must be absent or empty.
        seed: of all chance.
        truth_file: where to write what is hidden; None: nowhere.
        binary: an ELF file of the firmware, emulated and booted for each trial; None: the native core.

    Raises:
        SimError: out is in use, or the truth would lie inside it.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise SimError(f"{out}: exists and is not an empty folder; name a new one")
    if scenario.faults:
        raise SimError("[[faults]] need a line and a client: remove them, or use impid-sim serve")
    if truth_file is not None and truth_file.resolve().is_relative_to(out.resolve()):
        raise SimError(
            f"{truth_file}: lies inside the study, where the host could see it; name a place outside {out}"
        )
    out.mkdir(parents=True, exist_ok=True)
    write_setup(scenario, out / "setup.toml")
    begins: dict[str, int] = {}
    make = maker(binary)
    start_us = FIRST_US
    for trial in scenario.trials:
        folder = out / trial.name
        folder.mkdir()
        begins[trial.name], end_us = write_one_trial(scenario, trial, seed, start_us, folder, make)
        start_us = end_us + PAUSE_US
    if truth_file is not None:
        truth_file.parent.mkdir(parents=True, exist_ok=True)
        content = scenario_json(scenario, seed, begins, scenario.trials)
        truth_file.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


def write_one_trial(
    scenario: Scenario, trial: Trial, seed: int, start_us: int, folder: Path, make: BoardMaker
) -> tuple[int, int]:
    """Writes one trial's folder, from board time start_us if the board lets that be chosen.

    Returns:
        The board's time when the motion begins, and when the recording ends.
    """
    write_trial(trial, folder / "trial.toml")
    world = World(trial_truth(scenario, trial, seed))
    if scenario.setup.robot.single:
        return start_us, _write_axis(world, start_us, folder / "robot.csv")
    part = scenario.setup.accelerometer.part
    board = make(
        BoardConfig(start_us=start_us, serial_bytes_per_ms=scenario.world.serial.bytes_per_ms, part=part)
    )
    begin_us = board.next_tick_us + LEAD_US
    world.begin(begin_us)
    with_force = scenario.world.force_sensor is not None
    with (
        DeviceCsv(folder / "device.csv", third_axis=part == adxl355.PART) as device_csv,
        RobotCsv(
            folder / "robot.csv", with_force=with_force, with_command=trial.kind == "stochastic"
        ) as robot_csv,
    ):
        for block in stream(world, board):
            device_csv.add(block)
            for rows in world.take_log():
                robot_csv.add(rows)
    board.close()
    return begin_us, board.next_tick_us


def _write_axis(world: World, start_us: int, path: Path) -> int:
    """A single axis is logged by its drive alone; the end by the clock that a board would have."""
    now_us = start_us
    world.begin(start_us)
    with RobotCsv(path, with_force=False, single=True) as robot_csv:
        while not world.log_complete:
            world.read(now_us + TICK_US, BLOCK_TICKS)
            now_us += TICK_US * BLOCK_TICKS
            for rows in world.take_log():
                robot_csv.add(rows)
    return now_us


def stream(world: World, board: Board) -> Iterator[Samples]:
    """Starts the board and yields what it sends, until the robot's log is complete and a little longer.

    Raises:
        RuntimeError: the board did not accept START, or damaged its own frames.
    """
    reader = FrameReader()
    _run(world, board, 1)
    board.serial_receive(command(1, "START"), board.next_tick_us - TICK_US // 2)
    started = False
    last = False
    while not last:
        last = world.log_complete
        _run(world, board, TAIL_TICKS if last else BLOCK_TICKS)
        frames = reader.feed(board.serial_take())
        started = started or any(accepts_start(frame) for frame in frames)
        if not started or reader.damaged:
            raise RuntimeError(f"board out of order: started {started}, {reader.damaged} damaged frames")
        yield samples(frames)


def _run(world: World, board: Board, ticks: int) -> None:
    readings = world.read(board.next_tick_us, ticks, self_test=board.self_test_pin)
    board.run(readings.adc, readings.encoder)
