"""What the parts share: the boards of the tests, the recorder as a program, and where results go."""

import json
import os
import socket
import sys
import time
from pathlib import Path
from typing import Any

import can
from impid_host.link.can_bus import parse_address

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "build" / "validation" / "recording"
RECORD = [sys.executable, "-c", "from impid_host.cli import main; main()", "record"]
sys.path[:0] = [str(ROOT), str(ROOT / "bench")]
from clock_sync import board_us, exchanges  # noqa: E402

from tests.host.recording.boards import CanBoard, PtyBoard, SlcanBoard  # noqa: E402

__all__ = [
    "RECORD",
    "CanBoard",
    "PtyBoard",
    "SlcanBoard",
    "await_size",
    "board_us",
    "bus_at",
    "exchanges",
    "free_multicast",
    "save",
]


def save(part: str, **figures: Any) -> None:
    """Keep the figures of a part for the report."""
    RESULTS.mkdir(parents=True, exist_ok=True)
    command = f"python bench/recording/{Path(sys.argv[0]).name} {' '.join(sys.argv[1:])}".strip()
    busy = f"{os.getloadavg()[1]:.0f} processes wanting {os.cpu_count()} cores"
    text = json.dumps({"command": command, "machine": busy, **figures})
    (RESULTS / f"{part}.json").write_text(text + "\n", encoding="utf-8")
    print(text)


def await_size(path: Path, size: int, timeout_s: float = 60.0) -> None:
    """Wait until a file has grown to that size."""
    deadline = time.monotonic() + timeout_s
    while not (path.exists() and path.stat().st_size >= size):
        if time.monotonic() > deadline:
            raise TimeoutError(f"{path} does not grow to {size} bytes")
        time.sleep(0.002)


def bus_at(address: str) -> can.BusABC:
    """The bus of INTERFACE:CHANNEL[,OPTION=VALUE...], as python-can opens it."""
    interface, channel, options = parse_address(address)
    return can.Bus(interface=interface, channel=channel, **options)


def free_multicast() -> str:
    """A udp_multicast bus that nobody is on."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("", 0))
        return f"udp_multicast:239.74.163.2,port={free.getsockname()[1]}"
