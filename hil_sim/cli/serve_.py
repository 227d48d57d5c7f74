"""impid-sim serve"""

import os
import signal
import sys
import threading
from pathlib import Path

import click

from hil_sim.cli.options import ELF, FILE, SCENARIO, SEED, SENSOR
from hil_sim.scenarios.load import load
from hil_sim.scenarios.load import trial as find_trial
from hil_sim.scenarios.sensor import with_sensor
from hil_sim.serve.connect import CARRIERS, DEFAULT_CARRIER, CarrierName, Connection
from hil_sim.serve.session import ServeOptions, serve


@click.command("serve")
@SCENARIO
@click.option("--trial", metavar="NAME", help="Which trial of the scenario to run. Default: its first.")
@click.option(
    "--carrier",
    type=click.Choice(CARRIERS),
    default=DEFAULT_CARRIER,
    show_default=True,
    help="What lies between board and host.",
)
@click.option(
    "--address",
    metavar="WHERE",
    help="tcp: HOST:PORT; udp_multicast: GROUP:PORT; socketcan: the interface.",
)
@click.option(
    "--speed", type=click.FloatRange(min=0.1), default=1.0, show_default=True, help="Times real time."
)
@click.option("--robot-log", type=FILE, help="Where the robot's controller writes its torque log (CSV).")
@click.option(
    "--torques-to", metavar="HOST:PORT", help="Send each row of the torque log there at once, by UDP."
)
@SEED
@click.option("--link", type=FILE, help="pty, slcan: also make a symbolic link of this name to the terminal.")
@click.option("--setup", "setup_file", type=FILE, help="Write the laboratory's setup.toml here.")
@click.option("--truth", "truth_file", type=FILE, help="Write what is hidden here when the motion starts.")
@click.option("--flash", "flash_file", type=FILE, help="Keep the board's stored settings in this file.")
@click.option(
    "--tumble",
    "tumble_positions",
    type=click.IntRange(min=1),
    metavar="N",
    help="The board off the robot, on a dividing head that goes on by 360/N degrees after each stream.",
)
@SENSOR
@ELF
@click.option("--until-stdin-closes", is_flag=True, help="End when whoever started this is gone.")
def command(
    scenario: str,
    trial: str | None,
    carrier: CarrierName,
    address: str | None,
    speed: float,
    robot_log: Path | None,
    torques_to: str | None,
    seed: int,
    link: Path | None,
    setup_file: Path | None,
    truth_file: Path | None,
    flash_file: Path | None,
    tumble_positions: int | None,
    sensor: str | None,
    binary: Path | None,
    until_stdin_closes: bool,
) -> None:
    """Serve the sensor board of one trial: on a pseudo-terminal, over TCP, or on a CAN bus.

    Prints one line of JSON when the board can be reached, saying how, one for each fault that begins or
    ends, one when the trial is over, and one at the end. The robot rests until the board accepts START. Ends
    when the trial is over and the client has gone, or on SIGTERM.

    \b
    Examples:
      impid-sim serve first-light --trial free_01 --robot-log free_01.csv
      impid-sim serve first-light --torques-to 127.0.0.1:9870
      impid-sim serve first-light --carrier tcp --address 127.0.0.1:4000
      impid-sim serve first-light --carrier slcan --link /tmp/can-adapter
      impid-sim serve first-light --link /tmp/board --flash board.flash
    """
    loaded = with_sensor(load(scenario), sensor)
    if until_stdin_closes:
        threading.Thread(target=_end_with_stdin, daemon=True).start()
    serve(
        loaded,
        loaded.trials[0] if trial is None else find_trial(loaded, trial),
        ServeOptions(
            seed=seed,
            speed=speed,
            connection=Connection(carrier, address, link),
            robot_log=robot_log,
            torques_to=torques_to,
            setup_file=setup_file,
            truth_file=truth_file,
            flash_file=flash_file,
            tumble_positions=tumble_positions,
            binary=binary,
        ),
    )


def _end_with_stdin() -> None:
    """Nothing is ever written to it: a parent that is killed closes it, without having to say goodbye."""
    while os.read(sys.stdin.fileno(), 1):  # not the buffered reader: its lock would outlive the program
        pass
    signal.raise_signal(signal.SIGTERM)  # os.kill would end the program on Windows, handler or not
