"""Is this computer, and the board on it, fit to measure? Each finding says what is so and what to do."""

import os
import platform
import re
import shutil
import time
from collections.abc import Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import Literal, Protocol

import numpy as np
from serial.tools import list_ports

from impid_host.clock.device import ClockExchange, fit_clock
from impid_host.errors import LinkError, UndeterminedError
from impid_host.extras import EXTRAS, installed
from impid_host.link.address import Address
from impid_host.link.board_info import build_name
from impid_host.link.client import BoardClient
from impid_host.link.discovery import ST_LINK
from impid_host.link.link import Chunk
from impid_host.wire.messages import choices
from impid_host.wire.records import Decoded

State = Literal["good", "look", "bad"]
# A recording takes 68 kB/s on disk (20 s at 1 kHz: 1.36 MB); a day of measuring is 8 h.
_BYTES_PER_S = 70_000
_DAY_S = 8 * 3600.0
_LEAST_S = 1800.0
_LATE_MS = 20.0  # the serial driver's buffer holds 4 KiB, 250 ms of the stream
_PINGS, _PING_EVERY_S = 20, 0.03
_ANSWERS_S = 2.0  # waited for after the last ping
_SELF_TEST = {number: name for name, number in choices("STATUS_HEALTH", "self_test").items()}


@dataclass(frozen=True, slots=True)
class Finding:
    """One line.

    Attributes:
        what: versions, port, board, clock or disk; state: good, look (worth a look) or bad.
        remedy: what to do; "" where nothing is.
    """

    what: str
    state: State
    words: str
    remedy: str = ""


class Port(Protocol):
    """What pyserial tells of a port."""

    device: str
    vid: int | None
    pid: int | None


def examine(address: Address | None, folder: Path) -> Iterator[Finding]:
    """Everything, in the order of a bring-up.

    Args:
        address: of the board; None: the one board that is found by its USB id, if there is any.
        folder: where recordings go.
    """
    yield from versions()
    present = list(list_ports.comports())
    yield from ports(present)
    yield sleepiness()
    yield disk(folder)
    own = address
    if own is None and any((port.vid, port.pid) in ST_LINK for port in present):
        own = Address()
    if own is None:
        yield Finding(
            "board", "look", "none was found by its USB id", "plug it in, or name it: --port or --can"
        )
    else:
        yield from board(own)


def versions(package: str = "impid") -> Iterator[Finding]:
    """Python, impid and the packages that it needs or can use."""
    try:
        own = version(package)
        needed = [line for line in requires(package) or [] if "extra ==" not in line]
    except PackageNotFoundError:
        yield Finding("versions", "bad", f"{package} is not installed", f"pip install {package}")
        return
    system = f"Python {platform.python_version()}, {platform.system()} {platform.release()}"
    missing = [name for name in map(_name, needed) if not _installed(name)]
    if missing:
        words = f"{package} {own} lacks {', '.join(missing)}"
        yield Finding("versions", "bad", words, f"pip install --upgrade {package}")
    else:
        yield Finding("versions", "good", f"{package} {own}, {system}")
    without = [f"{extra} ({name})" for name, extra in EXTRAS.items() if not installed(name)]
    if without:
        words = f"extras that are not installed: {', '.join(without)}"
        yield Finding("versions", "good", f"{words}; pip install '{package}[NAME]' where one is needed")


def _name(requirement: str) -> str:
    return re.split(r"[\s\[<>=!~;]", requirement, maxsplit=1)[0]


def _installed(name: str) -> bool:
    try:
        version(name)
    except PackageNotFoundError:
        return False
    return True


def ports(present: Iterable[Port]) -> Iterator[Finding]:
    """Serial ports, and whether this user may open them."""
    named = sorted(present, key=lambda port: port.device)
    if not named:
        yield Finding(
            "port", "look", "this machine has no serial port", "plug the board in; try another cable"
        )
    for port in named:
        ours = " (a board, by its USB id)" if (port.vid, port.pid) in ST_LINK else ""
        allowed = os.name != "posix" or os.access(port.device, os.R_OK | os.W_OK)
        if allowed:
            yield Finding("port", "good", f"{port.device}{ours}")
        else:
            remedy = "sudo usermod -aG dialout $USER, then log in again"
            yield Finding(
                "port", "bad" if ours else "look", f"{port.device}{ours}: permission denied", remedy
            )


def sleepiness(naps: int = 50) -> Finding:
    """How late the computer wakes from a millisecond's sleep: a busy one stamps arrivals late."""
    late = []
    for _ in range(naps):
        before = time.perf_counter()
        time.sleep(1e-3)
        late.append(1e3 * (time.perf_counter() - before) - 1.0)
    worst = max(late)
    words = f"wakes {float(np.median(late)):.2f} ms late, {worst:.1f} ms at worst of {naps}"
    if worst > _LATE_MS:
        return Finding("clock", "look", words, "close other programs, or record on another computer")
    return Finding("clock", "good", words)


def disk(folder: Path) -> Finding:
    """How long one can record into a folder."""
    try:
        free = shutil.disk_usage(folder).free
    except OSError as error:
        return Finding("disk", "bad", f"{folder}: {error.strerror}", "name a folder that is there: --folder")
    if not os.access(folder, os.W_OK):
        return Finding("disk", "bad", f"{folder}: may not be written", "name another folder: --folder")
    seconds = free / _BYTES_PER_S
    words = f"{folder}: {free / 1e9:.1f} GB free, {seconds / 3600:.0f} h of recording"
    if seconds < _DAY_S:
        return Finding("disk", "bad" if seconds < _LEAST_S else "look", words, "free some space")
    return Finding("disk", "good", words)


class _Exchanges:
    """Keeps what pings bring back."""

    def __init__(self) -> None:
        self.kept: list[ClockExchange] = []

    def received(self, chunk: Chunk, decoded: Decoded) -> None: ...
    def sent(self, chunk: Chunk) -> None: ...
    def exchanged(self, exchange: ClockExchange, boot_id: int) -> None:  # noqa: ARG002
        self.kept.append(exchange)


def board(address: Address) -> Iterator[Finding]:
    """Who the board is, how it is, and its clock against the computer's."""
    exchanges = _Exchanges()
    try:
        with closing(BoardClient(address.open(), exchanges)) as client:
            info, status = client.info(), client.status()
            for _ in range(_PINGS):
                client.ping()
                client.pump(_PING_EVERY_S)
            deadline = time.monotonic() + _ANSWERS_S
            while len(exchanges.kept) < _PINGS and time.monotonic() < deadline:
                client.pump(_PING_EVERY_S)
    except LinkError as error:
        yield Finding("board", "bad", str(error))
        return
    uid = "-".join(f"{part:08x}" for part in (info.uid_0, info.uid_1, info.uid_2))
    yield Finding("board", "good", f"{uid}, firmware {build_name(info)}, {info.sample_rate_hz} Hz")
    tested = _SELF_TEST.get(status.self_test, str(status.self_test))
    if tested == "FAILED":
        remedy = "check the accelerometer's supply and wiring; impid-host device self-test"
        yield Finding("board", "bad", f"self-test {tested}", remedy)
    damaged = {
        name: count
        for name in ("line_errors", "late", "overruns", "encoder_faults", "saturated")
        if (count := getattr(status, name))
    }
    if damaged:
        words = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in damaged.items())
        yield Finding("board", "look", f"since its start: {words}", "impid-host device log tells more")
    yield _clock(exchanges.kept)


def _clock(exchanges: list[ClockExchange]) -> Finding:
    try:
        estimate = fit_clock(exchanges)
    except UndeterminedError as error:
        return Finding("clock", "bad", f"the board's clock: {error}", "try another cable or port")
    words = f"board's clock known to {estimate.hard_bound_us:.0f} us after {len(exchanges)} pings"
    return Finding("clock", "good", words)
