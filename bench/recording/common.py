"""What the parts share: the boards of the tests, the recorder as a program, and where results go."""

import json
import os
import sys
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "build" / "validation" / "recording"
RECORD = [sys.executable, "-c", "from impid_host.cli import main; main()", "record"]
sys.path.insert(0, str(ROOT / "tests" / "host" / "recording"))
from boards import CanBoard, PtyBoard, SlcanBoard  # noqa: E402

__all__ = ["RECORD", "CanBoard", "PtyBoard", "SlcanBoard", "await_size", "save"]


def save(part: str, **figures: Any) -> None:
    """Keep the figures of a part for the report."""
    RESULTS.mkdir(parents=True, exist_ok=True)
    command = f"python bench/recording/{part}.py {' '.join(sys.argv[1:])}".strip()
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
