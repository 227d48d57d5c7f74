"""`impid-host device`: talk to the board without recording."""

import json
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import asdict
from pathlib import Path

import click
import numpy as np

from impid_host.calibration.accelerometer import AccelerometerCalibration
from impid_host.calibration.in_place import calibrate_in_place
from impid_host.calibration.motion import predicted_specific_force
from impid_host.calibration.tumble import calibrate_by_angles, calibrate_by_circle
from impid_host.cli.device_bring_up import bring_up_command
from impid_host.cli.device_update import update
from impid_host.cli.link_options import Command, address_of, link_options
from impid_host.errors import InputError, LinkError
from impid_host.link.board_info import build_name
from impid_host.link.client import FAULT_RECORD, SETTINGS, BoardClient
from impid_host.link.readings import mean_codes
from impid_host.recording.reader import read_recording
from impid_host.samples import rows_of
from impid_host.signals.counts import longest_run, usable_samples
from impid_host.study.setup_file import read_setup
from impid_host.wire.messages import SAMPLE_PERIOD_US, choices

_SELF_TEST = {number: name for name, number in choices("STATUS_HEALTH", "self_test").items()}
_RESET = {number: name for name, number in choices("STATUS_HEALTH", "reset_cause").items()}
_CLOCK = {number: name for name, number in choices("STATUS_HEALTH", "clock_source").items()}
_HEXADECIMAL = frozenset(f"fault_{name}" for name in ("pc", "lr", "psr", "cfsr", "hfsr", "address"))
_STATE = {number: name for name, number in choices("STATUS_HEALTH", "state").items()}


@click.group()
def command() -> None:
    """Talk to the board: who it is, how it is, what it keeps.

    \b
    Examples:
      impid-host device info --port auto
      impid-host device set --port /dev/ttyACM0 ENCODER_1_CPR 8192
      impid-host device calibrate tumble --port auto --out board.json --save
    """


command.add_command(update)
command.add_command(bring_up_command)


@contextmanager
def _board(port: str | None, can: str | None, baud: int | None) -> Iterator[BoardClient]:
    with closing(BoardClient(address_of(port, can, baud).open())) as client:
        yield client


@command.command()
@link_options
@click.option("--json", "as_json", is_flag=True, help="For programs.")
def info(*, port: str | None, can: str | None, baud: int | None, as_json: bool) -> None:
    """Who the board is, how it is, and what it keeps without power.

    \b
    Example:
      impid-host device info --port /dev/ttyACM0
    """
    with _board(port, can, baud) as client:
        board, status, settings = client.info(), client.status(), client.settings()
    if as_json:
        told = {"board": asdict(board), "status": asdict(status), "settings": settings}
        click.echo(json.dumps(told))
        return
    values = asdict(board) | {"uid": f"{board.uid_0:08x}-{board.uid_1:08x}-{board.uid_2:08x}"}
    values = {name: value for name, value in values.items() if not name.startswith("uid_")}
    values |= {"reset_cause": _RESET.get(board.reset_cause, board.reset_cause)}
    values |= {"clock_source": _CLOCK.get(board.clock_source, board.clock_source)}
    values = {"firmware": build_name(board)} | {
        name: value
        for name, value in values.items()
        if value is not None and not name.startswith(("firmware_", "build_"))
    }
    states = {"state": _STATE.get(status.state, status.state)}
    states |= {"self_test": _SELF_TEST.get(status.self_test, status.self_test)}
    counters = {
        k: v for k, v in asdict(status).items() if k not in ("boot_id", "t_us", "reset_cause", "clock_source")
    }
    for title, entries in (("board", values), ("status", counters | states), ("settings", settings)):
        click.echo(f"{title}:")
        for name, value in entries.items():
            click.echo(f"  {name:18} {value}")
        if not entries:
            click.echo("  none: the firmware of this board keeps no settings")


@command.command("self-test")
@link_options
def self_test(*, port: str | None, can: str | None, baud: int | None) -> None:
    """Drive the accelerometer's self-test input and judge its answer; fails if it fails.

    \b
    Example:
      impid-host device self-test --port auto
    """
    with _board(port, can, baud) as client:
        outcome = _SELF_TEST.get(client.self_test(), "UNKNOWN")
        board = client.info()
    responses = {"x": board.self_test_x_mv, "y": board.self_test_y_mv, "z": board.self_test_z_mv}
    unit = "mV" if board.self_test_z_mv is None else "mg"  # analog sensors have two axes, digital ones three
    told = ", ".join(f"{axis} {_signed(v)} {unit}" for axis, v in responses.items() if v is not None)
    click.echo(f"self-test {outcome}: response {told}")
    if outcome != "PASSED":
        raise LinkError(
            f"self-test {outcome}; check the accelerometer's supply and wiring, and that it rests"
        )


@command.command("set")
@link_options
@click.argument("item", metavar="ITEM", type=click.Choice(SETTINGS, case_sensitive=False))
@click.argument("value", type=click.IntRange(0, 2**32 - 1))
def set_(*, port: str | None, can: str | None, baud: int | None, item: str, value: int) -> None:
    """Set one of the board's settings and save it.

    \b
    Example:
      impid-host device set --port auto ENCODER_1_CPR 8192
    """
    with _board(port, can, baud) as client:
        client.store({item: value})
    click.echo(f"{item} = {value}, saved")


@command.command()
@link_options
def reset(*, port: str | None, can: str | None, baud: int | None) -> None:
    """Restart the board, and wait until it answers again.

    \b
    Example:
      impid-host device reset --can socketcan:can0
    """
    with _board(port, can, baud) as client:
        before, after = client.restart()
    click.echo(f"boot {before} ended, boot {after} answers")


@command.command()
@link_options
def log(*, port: str | None, can: str | None, baud: int | None) -> None:
    """What the board remembers of its last fault.

    \b
    Example:
      impid-host device log --port auto
    """
    with _board(port, can, baud) as client:
        record, last = client.fault_record(), client.last_stream()
    if not record:
        click.echo("the firmware of this board keeps no fault record")
    elif not record[FAULT_RECORD[0].lower()]:
        click.echo("no fault since its power came")
    else:
        for name, value in record.items():
            click.echo(f"  {name:18} {f'0x{value:08x}' if name in _HEXADECIMAL else value}")
    if last is not None:
        click.echo(
            f"boot {last.boot_id}, before this one, had made {last.produced} samples since its last START"
        )


@command.group()
def calibrate() -> None:
    """Offsets, gains and misalignment of the accelerometer, with their intervals.

    \b
    Examples:
      impid-host device calibrate tumble --port auto --out board.json --save
      impid-host device calibrate in-place free_01.mcap --setup rig.toml --out board.json
      impid-host record --port auto --calibration board.json --out free_02.mcap
    """


def _result_options(function: Command) -> Command:
    out = click.option(
        "--out", required=True, type=click.Path(path_type=Path), metavar="FILE.json", help="File to write."
    )
    save = click.option("--save", is_flag=True, help="Store them and their intervals on the board as well.")
    return out(save(function))


@calibrate.command()
@link_options
@_result_options
@click.option("--positions", default=8, show_default=True, type=click.IntRange(min=6), help="How many.")
@click.option("--seconds", default=2.0, show_default=True, type=click.FloatRange(min=0.1), help="In each.")
@click.option(
    "--angles",
    metavar="DEG,DEG,...",
    help="Angles from the board's x axis to the vertical, where a dividing head knows them.",
)
def tumble(
    *,
    port: str | None,
    can: str | None,
    baud: int | None,
    out: Path,
    save: bool,
    positions: int,
    seconds: float,
    angles: str | None,
) -> None:
    """By gravity: the board stands upright, at rest, in positions all round the circle.

    \b
    Example:
      impid-host device calibrate tumble --port auto --out board.json --save
    """
    known = _angles(angles)
    count = positions if known is None else len(known)
    _refuse_existing(out)
    with _board(port, can, baud) as client:
        codes = []
        for number in range(count):
            where = "" if known is None else f" at {np.degrees(known[number]):g} degrees"
            click.prompt(
                f"position {number + 1} of {count}{where}: upright and still, then Enter",
                default="",
                show_default=False,
                prompt_suffix=" ",
            )
            codes.append(mean_codes(client, seconds))
        readings = np.array(codes)
        found = calibrate_by_circle(readings) if known is None else calibrate_by_angles(readings, known)
        _keep(found, out, client if save else None)


@calibrate.command("in-place")
@link_options
@_result_options
@click.argument("file", type=click.Path(path_type=Path), metavar="FILE.mcap")
@click.option(
    "--setup",
    "setup_file",
    required=True,
    type=click.Path(path_type=Path),
    metavar="TOML",
    help="The apparatus.",
)
def in_place(
    *,
    port: str | None,
    can: str | None,
    baud: int | None,
    out: Path,
    save: bool,
    file: Path,
    setup_file: Path,
) -> None:
    """Where it is mounted: the acceleration of a recorded motion against that of the encoders.

    \b
    Example:
      impid-host device calibrate in-place free_01.mcap --setup rig.toml --out board.json
    """
    if not save and (port, can, baud) != (None, None, None):
        raise click.UsageError("--port, --can and --baud are for --save")
    _refuse_existing(out)
    segments = read_recording(file).segments
    if not segments:
        raise InputError(file, "holds no samples", "record a free motion of at least 15 s")
    samples = max(segments, key=len).samples
    samples = rows_of(samples, longest_run(samples))
    whole = np.diff(samples.t_us.astype(np.int64)) == SAMPLE_PERIOD_US
    if not (whole.all() and usable_samples(samples).all()):
        raise InputError(file, "has gaps, saturated samples or encoder faults", "calibrate on a clean motion")
    rate_hz = 1e6 / SAMPLE_PERIOD_US
    predicted_g = predicted_specific_force(samples, read_setup(setup_file), rate_hz)
    codes = np.column_stack([samples.ax, samples.ay]).astype(np.float64)
    found = calibrate_in_place(codes, predicted_g, rate_hz)
    if save:
        with _board(port, can, baud) as client:
            _keep(found, out, client)
    else:
        _keep(found, out, None)


def _keep(found: AccelerometerCalibration, out: Path, client: BoardClient | None) -> None:
    try:
        out.write_text(found.to_json(), encoding="utf-8")
    except OSError as error:
        raise InputError(out, f"cannot be written ({error.strerror})", "choose another place") from None
    click.echo(str(found))
    click.echo(
        f"written to {out}; give it to `impid-host record --calibration` or to `impid-host export "
        "--calibration`: export and fit then use these numbers in place of setup.toml's"
    )
    if client is not None:
        client.store(found.board_settings())
        click.echo("stored on the board; recordings that it makes carry them, and export and fit use them")


def _angles(text: str | None) -> np.ndarray | None:
    if text is None:
        return None
    try:
        return np.radians([float(part) for part in text.split(",")])
    except ValueError:
        raise click.UsageError(f"--angles {text}: give degrees, separated by commas") from None


def _refuse_existing(path: Path) -> None:
    if path.exists():
        raise InputError(path, "exists already", "choose another name or move it away")
    if not path.parent.is_dir():
        raise InputError(path, "its folder does not exist", f"make it first: mkdir -p {path.parent}")


def _signed(word: int) -> int:
    return word - (1 << 32) if word >= 1 << 31 else word
