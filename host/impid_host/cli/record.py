"""`impid-host record`: the board's stream into an MCAP file."""

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from impid_host import __version__
from impid_host.clock.device import fit_clock
from impid_host.errors import InputError, LinkError, UndeterminedError
from impid_host.link.client import BoardClient
from impid_host.link.port import SerialLink
from impid_host.link.simulator import Simulator
from impid_host.recording import channels
from impid_host.recording.display import progress_display
from impid_host.recording.reader import read_recording
from impid_host.recording.recorder import Outcome, Recorder
from impid_host.recording.writer import RecordingWriter
from impid_host.wire.messages import SERIAL_BAUD

# The thread that stamps what the port receives must not wait 5 ms (Python's default) for a busy main thread.
_SWITCH_INTERVAL_S = 0.0005


@click.command()
@click.option("--port", metavar="PORT", help="Serial device, or an address such as socket://host:port.")
@click.option("--sim", metavar="SCENARIO[:TRIAL]", help="Start the simulator and record its board instead.")
@click.option(
    "--duration", type=click.FloatRange(min=0, min_open=True), metavar="S", help="Seconds to record."
)
@click.option(
    "--out", required=True, type=click.Path(path_type=Path), metavar="FILE.mcap", help="File to write."
)
@click.option("--baud", default=SERIAL_BAUD, show_default=True, help="Speed of the serial line.")
@click.option(
    "--speed", default=1.0, type=click.FloatRange(min=0, min_open=True), help="Simulator: times real time."
)
@click.option("--seed", type=int, help="Simulator: seed of its noise.")
@click.option(
    "--truth",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Simulator: where it writes what it hides, for checking results.",
)
def command(
    *,
    port: str | None,
    sim: str | None,
    duration: float | None,
    out: Path,
    baud: int,
    speed: float,
    seed: int | None,
    truth: Path | None,
) -> None:
    """Record the sensor board (or the simulator) into an MCAP file.

    The file keeps the raw bytes of the line beside the decoded samples, opens in Foxglove and PlotJuggler,
    and survives a crash up to its last 0.1 s. An existing file is never overwritten. Without --duration the
    recording runs until Ctrl-C, which ends it in good order. The duration is counted in samples, on the
    board's clock.

    With --sim (`impid-sim list` shows the scenarios and their trials) the robot's torque log and the
    apparatus are written beside the recording, as FILE.robot.csv and FILE.setup.toml, and without --duration
    the recording ends with the trial.

    \b
    Examples:
      impid-host record --port /dev/ttyACM0 --duration 50 --out free_01.mcap
      impid-host record --sim first-light:free_01 --speed 5 --out free_01.mcap
    """
    if (port is None) == (sim is None):
        raise click.UsageError("give either --port or --sim")
    if sim is None and (speed != 1.0 or seed is not None or truth is not None):
        raise click.UsageError("--speed, --seed and --truth are for --sim only")
    robot_log, setup = out.with_suffix(".robot.csv"), out.with_suffix(".setup.toml")
    for path in (out, robot_log, setup, truth) if sim else (out,):
        if path is not None:
            _refuse_existing(path)
    with ExitStack() as stack:
        signalled = stack.enter_context(_stop_on_signal())
        stopped: Callable[[], bool] = signalled.is_set
        if sim:
            served = stack.enter_context(
                Simulator.start(sim, speed=speed, seed=seed, robot_log=robot_log, setup=setup, truth=truth)
            )
            port = served.port
            click.echo(f"simulating {sim.partition(':')[0]}:{served.trial}", err=True)
            if duration is None:
                stopped = lambda: signalled.is_set() or served.finished  # noqa: E731
        link = stack.enter_context(SerialLink.open(str(port), baud))
        asked = {"port": port, "sim": sim, "duration": duration, "baud": baud, "speed": speed, "seed": seed}
        outcome = _record(link, out, duration, stopped, {k: v for k, v in asked.items() if v is not None})
    _conclude(outcome, out, duration, speed)


def _record(
    link: SerialLink, out: Path, duration_s: float | None, stopped: Callable[[], bool], asked: dict[str, Any]
) -> Outcome:
    client = BoardClient(link)
    board = {name: str(value) for name, value in asdict(client.info()).items()}
    host = {"version": __version__} | {name: str(value) for name, value in asked.items()}
    metadata = {channels.METADATA_HOST: host, channels.METADATA_BOARD: board}
    rate = float(asked["speed"])
    writer = RecordingWriter.create(out, metadata, nominal_rate=rate)
    summary = {"ending": "failed"}
    try:
        recorder = Recorder(client, writer, nominal_rate=rate)
        with progress_display(Console(stderr=True), out.name, duration_s) as show:
            outcome = recorder.run(duration_s or float("inf"), stopped=stopped, report=show)
        summary = {"ending": outcome.ending} | {k: str(v) for k, v in asdict(outcome.progress.counts).items()}
    finally:
        # After a full disk the file is whole up to its last flush, without an index; its reader says so.
        with suppress(InputError):
            writer.close(summary)
    return outcome


def _conclude(outcome: Outcome, out: Path, duration_s: float | None, speed: float) -> None:
    """The last line, from what is really in the file; raises where that is not what was asked for."""
    recording = read_recording(out)
    stored = sum(ledger.stored for ledger in recording.ledgers)
    lost = sum(ledger.lost for ledger in recording.ledgers)
    try:
        clock = str(fit_clock(list(outcome.exchanges), nominal_rate=speed))
    except UndeterminedError as error:
        clock = f"clock not determined: {error}"
    books = "; ".join(str(ledger) for ledger in recording.ledgers) or "no samples"
    click.echo(f"{out}: {stored} samples stored, {lost} lost, {recording.duration_s:.3f} s; {clock}; {books}")
    if outcome.ending == "disconnected":
        raise LinkError(f"{outcome.trouble}; what was recorded until then is kept in {out}")
    if outcome.ending == "disk-full":
        raise LinkError(outcome.trouble)
    if recording.warnings:
        raise LinkError(recording.warnings[0])
    if any(ledger.balanced is False for ledger in recording.ledgers):
        raise LinkError(
            f"{out}: the board's count of samples does not agree with what arrived; see the line above"
        )
    if outcome.ending == "interrupted" and duration_s is not None:
        raise LinkError(
            f"{out}: interrupted before the {duration_s:g} s asked for; what was recorded is kept"
        )


def _refuse_existing(path: Path) -> None:
    if path.exists():
        raise InputError(
            path, "exists already", "recordings are never overwritten: choose another name or move it away"
        )
    if not path.parent.is_dir():
        raise InputError(path, "its folder does not exist", f"make it first: mkdir -p {path.parent}")


@contextmanager
def _stop_on_signal() -> Iterator[threading.Event]:
    """An event that Ctrl-C or SIGTERM sets, instead of ending the program half-way."""
    stopped = threading.Event()
    before = {s: signal.signal(s, lambda *_: stopped.set()) for s in (signal.SIGINT, signal.SIGTERM)}
    interval = sys.getswitchinterval()
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    try:
        yield stopped
    finally:
        sys.setswitchinterval(interval)
        for number, handler in before.items():
            signal.signal(number, handler)
