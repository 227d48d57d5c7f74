"""`impid-host record`: the board's stream into an MCAP file."""

import ipaddress
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path

import click
from rich.console import Console

from impid_host import __version__
from impid_host.calibration.applied import apply as apply_calibration
from impid_host.calibration.applied import as_metadata, read_calibration, recorded_calibration
from impid_host.cli.link_options import address_of, link_options
from impid_host.cli.record_force import ForceWish, force_options, force_wish
from impid_host.clock.device import fit_clock
from impid_host.errors import InputError, LinkError, UndeterminedError
from impid_host.extras import need
from impid_host.link.address import Address
from impid_host.link.board_info import build_name
from impid_host.link.client import BoardClient
from impid_host.link.simulator import Simulator
from impid_host.recording import channels
from impid_host.recording.display import progress_display
from impid_host.recording.reader import survey
from impid_host.recording.recorder import SILENCE_S, Outcome, Progress, Recorder
from impid_host.recording.writer import RecordingWriter
from impid_host.study.model import Setup
from impid_host.study.setup_file import read_setup
from impid_host.view.live_view import LiveView
from impid_host.view.scale import scale_of
from impid_host.wire.messages import SAMPLE_PERIOD_US

# The thread that stamps what the port receives must not wait 5 ms (Python's default) for a busy main thread.
_SWITCH_INTERVAL_S = 0.0005
_BOARD_RATE_HZ = 1e6 / SAMPLE_PERIOD_US
_SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


@dataclass(frozen=True, slots=True)
class _Order:
    """What to record, and where to."""

    out: Path
    address: Address
    duration_s: float | None
    speed: float
    patience_s: float
    asked: dict[str, str]
    calibration: dict[str, str]
    view_at: tuple[str, int] | None
    apparatus: Setup | None
    apparatus_file: Path | None = None
    force: ForceWish | None = None


@click.command()
@link_options
@click.option("--sim", metavar="SCENARIO[:TRIAL]", help="Start the simulator and record its board instead.")
@click.option(
    "--duration", type=click.FloatRange(min=0, min_open=True), metavar="S", help="Seconds to record."
)
@click.option(
    "--out", required=True, type=click.Path(path_type=Path), metavar="FILE.mcap", help="File to write."
)
@click.option(
    "--calibration",
    "calibration_file",
    type=click.Path(path_type=Path),
    metavar="FILE.json",
    help="Calibration of the accelerometer, kept in the recording; `export` and `fit` apply it.",
)
@click.option(
    "--reconnect",
    default=30.0,
    show_default=True,
    type=click.FloatRange(min=0),
    metavar="S",
    help="How long to wait for a board that has gone; 0: not at all.",
)
@click.option("--view", is_flag=True, help="Serve a page that shows the recording live.")
@click.option(
    "--setup",
    "setup_file",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="setup.toml of the apparatus, so that the page shows rad and m/s^2 by its numbers.",
)
@click.option(
    "--view-address",
    default="127.0.0.1:0",
    metavar="HOST:PORT",
    show_default=True,
    help="Where to serve it; port 0: any that is free. Other machines reach it only if told here.",
)
@force_options
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
    can: str | None,
    baud: int | None,
    sim: str | None,
    duration: float | None,
    out: Path,
    calibration_file: Path | None,
    reconnect: float,
    view: bool,
    setup_file: Path | None,
    view_address: str,
    model: Path | None,
    torques: str | None,
    force_window: float,
    force_log: Path | None,
    speed: float,
    seed: int | None,
    truth: Path | None,
) -> None:
    """Record the sensor board (or the simulator) into an MCAP file.

    The file keeps the raw bytes of the line beside the decoded samples, opens in Foxglove and PlotJuggler,
    and survives a crash up to its last 0.1 s. An existing file is never overwritten. Without --duration the
    recording runs until Ctrl-C, which ends it in good order. The duration is counted in samples, on the
    board's clock.

    When the cable is pulled or the board is reset, the recording waits for it and goes on; what comes after a
    reset is a run of its own, because the board's clock has begun anew.

    With --sim (`impid-sim list` shows the scenarios and their trials) the robot's torque log and the
    apparatus are written beside the recording, as FILE.robot.csv and FILE.setup.toml, and without --duration
    the recording ends with the trial.

    With --force the page also shows the force of the load on the robot, by a saved model and the torques that
    the robot's controller sends as UDP lines `t,theta1,theta2,tau1,tau2`, and the stiffness over the last
    seconds with its interval. It is worked out beside the recording, which does not depend on it.

    \b
    Examples:
      impid-host record --port /dev/ttyACM0 --duration 50 --out free_01.mcap
      impid-host record --port auto --duration 50 --out free_01.mcap
      impid-host record --can socketcan:can0 --duration 50 --out free_01.mcap
      impid-host record --port auto --view --setup rig.toml --out free_02.mcap
      impid-host record --port auto --view --setup rig.toml --force model.json --out arm_01.mcap
      impid-host record --sim first-light:free_01 --speed 5 --out free_01.mcap
    """
    if (port is None and can is None) == (sim is None):
        raise click.UsageError("give either --port, --can or --sim")
    if sim is None and (speed != 1.0 or seed is not None or truth is not None):
        raise click.UsageError("--speed, --seed and --truth are for --sim only")
    if setup_file is not None and (sim is not None or not view):
        raise click.UsageError("--setup is for --view; a simulated board brings its own")
    address = address_of(port, can, baud)
    apparatus = None if setup_file is None else read_setup(setup_file)
    force = force_wish(model, torques, force_window, force_log, sim=sim, view=view, setup=setup_file)
    view_at = _host_and_port(view_address) if view else None
    calibration = (
        {} if calibration_file is None else as_metadata(read_calibration(calibration_file).calibration)
    )
    robot_log, setup = out.with_suffix(".robot.csv"), out.with_suffix(".setup.toml")
    for path in (out, force_log, *((robot_log, setup, truth) if sim else ())):
        if path is not None:
            _refuse_existing(path)
    with ExitStack() as stack:
        signalled = stack.enter_context(_stop_on_signal())
        stopped: Callable[[], bool] = signalled.is_set
        if sim:
            served = stack.enter_context(
                Simulator.start(
                    sim,
                    speed=speed,
                    seed=seed,
                    robot_log=robot_log,
                    setup=setup,
                    truth=truth,
                    torques_to=None if force is None else force.torques,
                )
            )
            address.port = served.port
            apparatus, setup_file = read_setup(setup), setup
            click.echo(f"simulating {sim.partition(':')[0]}:{served.trial}", err=True)
            if duration is None:
                stopped = lambda: signalled.is_set() or served.finished  # noqa: E731
        if force is not None and apparatus is not None:
            force.check(apparatus)
        asked = {
            "port": address.port,
            "can": can,
            "sim": sim,
            "duration": duration,
            "baud": baud,
            "seed": seed,
        }
        said = {name: str(value) for name, value in asked.items() if value is not None}
        order = _Order(
            out, address, duration, speed, reconnect, said, calibration, view_at, apparatus, setup_file, force
        )
        outcome = _record(order, stopped)
    _conclude(outcome, order)
    if sim:
        click.echo(f"next: impid-host export {out} --out study/ && impid-host check study/", err=True)


def _record(order: _Order, stopped: Callable[[], bool]) -> Outcome:
    with ExitStack() as stack:
        link = order.address.open()
        client = stack.enter_context(closing(BoardClient(link)))
        carrier = link.carrier.name
        writer = RecordingWriter.create(
            order.out, _metadata(client, order, carrier), nominal_rate=order.speed, carrier=carrier
        )
        summary = {"ending": "failed"}
        try:
            view = None
            if order.view_at is not None:
                view = stack.enter_context(_announced_view(order, order.view_at, client))
            recorder = Recorder(
                client,
                writer,
                nominal_rate=order.speed,
                open_link=order.address.open,
                patience_s=order.patience_s if order.address.comes_back else 0.0,
                # What cannot be opened again is held on to.
                silence_s=SILENCE_S if order.address.comes_back else max(SILENCE_S, order.patience_s),
                onlooker=view,
            )
            recorder.identify()
            with progress_display(Console(stderr=True), order.out.name, order.duration_s) as show:
                outcome = recorder.run(
                    order.duration_s or float("inf"),
                    stopped=stopped if view is None else lambda: stopped() or view.stop_requested,
                    report=show if view is None else _shown_on(view, show, recorder),
                )
            counts = asdict(outcome.progress.counts)
            summary = {"ending": outcome.ending} | {name: str(count) for name, count in counts.items()}
        finally:
            # After a full disk the file is whole up to its last flush, without an index; its reader says so.
            with suppress(InputError):
                writer.close(summary)
    return outcome


def _calibrated(client: BoardClient, order: _Order) -> Setup | None:
    """The apparatus, where it is described; a calibration goes first."""
    kept = {name: str(value) for name, value in client.settings().items()}
    found = recorded_calibration(
        {channels.METADATA_CALIBRATION: order.calibration, channels.METADATA_SETTINGS: kept}
    )
    if order.apparatus is None or found is None:
        return order.apparatus
    return apply_calibration(order.apparatus, found, order.out)[0]


def _announced_view(order: _Order, at: tuple[str, int], client: BoardClient) -> LiveView:
    need("aiohttp", "the live view")
    setup = _calibrated(client, order)
    # By the apparatus, else by the board's settings.
    scale = scale_of(setup, client.settings(), client.info().full_scale_code)
    observer = None
    if order.force is not None and setup is not None and order.apparatus_file is not None:
        observer = order.force.order(order.apparatus_file, setup.accelerometer)
    view = LiveView.start(scale, _BOARD_RATE_HZ, *at, observer=observer)
    click.echo(f"live view: {view.url}  (token for stopping and marking: {view.token})", err=True)
    if order.force is not None:
        click.echo(f"force: the robot's torques are awaited at UDP {order.force.torques}", err=True)
    return view


def _shown_on(
    view: LiveView, show: Callable[[Progress], None], recorder: Recorder
) -> Callable[[Progress], None]:
    def report(progress: Progress) -> None:
        show(progress)
        view.progress(progress)
        for text in view.take_marks():
            recorder.note("mark", text=text)

    return report


def _host_and_port(address: str) -> tuple[str, int]:
    host, _, port = address.rpartition(":")
    try:
        return str(ipaddress.ip_address(host.strip("[]"))), int(port)
    except ValueError:
        raise click.UsageError(
            f"--view-address {address}: give an IP address and a port, e.g. 127.0.0.1:8077"
        ) from None


def _metadata(client: BoardClient, order: _Order, carrier: str) -> dict[str, dict[str, str]]:
    host = {"version": __version__, "carrier": carrier, "speed": str(order.speed)} | order.asked
    info = client.info()
    board = {name: str(value) for name, value in asdict(info).items() if value is not None}
    board["firmware"] = build_name(info)
    settings = {name: str(value) for name, value in client.settings().items()}
    return {
        channels.METADATA_HOST: host,
        channels.METADATA_BOARD: board,
        channels.METADATA_SETTINGS: settings,
        channels.METADATA_CALIBRATION: order.calibration,
    }


def _conclude(outcome: Outcome, order: _Order) -> None:
    """The last line, from what is really in the file; raises where that is not what was asked for."""
    out, duration_s = order.out, order.duration_s
    recording = survey(out)
    stored = sum(ledger.stored for ledger in recording.ledgers)
    lost = sum(ledger.lost for ledger in recording.ledgers)
    try:
        clock = str(fit_clock(list(outcome.exchanges), nominal_rate=order.speed))
    except UndeterminedError as error:
        clock = f"clock not determined: {error}"
    books = "; ".join(str(ledger) for ledger in recording.ledgers) or "no samples"
    click.echo(f"{out}: {stored} samples stored, {lost} lost, {recording.duration_s:.3f} s; {clock}; {books}")
    if outcome.ending == "disconnected":
        raise LinkError(f"{outcome.trouble}; what was recorded until then is kept in {out}")
    if outcome.ending == "disk-full":
        missing = (
            outcome.progress.counts.stored - stored - sum(ledger.surplus for ledger in recording.ledgers)
        )
        raise LinkError(f"{outcome.trouble}; {missing} samples that had arrived are missing at its end")
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
    before = {s: signal.signal(s, lambda *_: stopped.set()) for s in _SIGNALS}
    interval = sys.getswitchinterval()
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    try:
        yield stopped
    finally:
        sys.setswitchinterval(interval)
        for number, handler in before.items():
            signal.signal(number, handler)
