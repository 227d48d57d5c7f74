"""`record --force`: what has to be clear before a recording begins whose force is observed."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from impid_host.study.model import AccelerometerSetup, Setup

Command = Callable[..., Any]
DEFAULT_TORQUES = "127.0.0.1:9870"


@dataclass(frozen=True, slots=True)
class ForceWish:
    """What the options ask for.

    Attributes:
        model: what `fit --save-model` wrote; host, port: where the robot's torques arrive.
        window_s: of the running stiffness; log: where what is shown is kept, or None.
    """

    model: Path
    host: str
    port: int
    window_s: float
    log: Path | None

    @property
    def torques(self) -> str:
        """HOST:PORT."""
        return f"{self.host}:{self.port}"

    def check(self, setup: Setup) -> None:
        """Have the model read before anything is recorded, and say what of it is not used.

        Raises:
            InputError: the model cannot be used with this apparatus.
        """
        from impid_host.live.order import known_robot  # noqa: PLC0415  (seconds, for who asks for it)

        _, left_out = known_robot(self.model, setup)
        if left_out:
            click.echo(f"warning: {left_out}", err=True)

    def order(self, setup: Path, accelerometer: AccelerometerSetup | None) -> dict[str, Any]:
        """For the observer's process.

        Args:
            accelerometer: the setup's, calibrated.
        """
        from impid_host.live.order import Order  # noqa: PLC0415

        return Order(
            self.model, setup, accelerometer, self.host, self.port, self.window_s, self.log
        ).to_dict()


def force_options(command: Command) -> Command:
    """Adds --force, --torques, --force-window and --force-log."""
    for option in reversed(
        (
            click.option(
                "--force",
                "model",
                type=click.Path(path_type=Path),
                metavar="MODEL",
                help="Show the load's force and running stiffness, by what `fit --save-model` wrote.",
            ),
            click.option(
                "--torques",
                metavar="HOST:PORT",
                help="UDP port at which the robot's controller sends rows of its torque log while it moves. "
                f"Default: {DEFAULT_TORQUES}; other machines reach it only if told here.",
            ),
            click.option(
                "--force-window",
                default=8.0,
                show_default=True,
                type=click.FloatRange(min=4.0),
                metavar="S",
                help="Seconds that the running stiffness rests on.",
            ),
            click.option(
                "--force-log",
                type=click.Path(path_type=Path),
                metavar="FILE.jsonl",
                help="Keep what is shown of force and stiffness, a line of JSON each.",
            ),
        )
    ):
        command = option(command)
    return command


def force_wish(
    model: Path | None,
    torques: str | None,
    window_s: float,
    log: Path | None,
    *,
    sim: str | None,
    view: bool,
    setup: Path | None,
) -> ForceWish | None:
    """The options together; None where no force is asked for.

    Raises:
        LinkError: no torques can be received there.
        click.UsageError: options that contradict each other.
    """
    if model is None:
        if torques is not None or log is not None:
            raise click.UsageError("--torques and --force-log are for --force")
        return None
    if not view:
        raise click.UsageError("--force is shown on the live page: add --view")
    if sim is None and setup is None:
        raise click.UsageError("--force needs the apparatus: add --setup rig.toml")
    if sim is not None and torques is not None:
        raise click.UsageError("--torques is for a robot; the simulated one finds its way")
    from impid_host.live.torques import open_port  # noqa: PLC0415

    host, _, port = (torques or DEFAULT_TORQUES).rpartition(":")
    if not host or not port.isdecimal():
        raise click.UsageError(f"--torques {torques}: give HOST:PORT, e.g. {DEFAULT_TORQUES}")
    host = host.strip("[]")
    # Held for a moment, to know before the recording begins whether it can be had.
    with open_port(host, 0 if sim else int(port)) as own:
        return ForceWish(model, host, own.getsockname()[1], window_s, log)
