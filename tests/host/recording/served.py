"""The recorder as a program on the board of `impid-sim serve`, while the scenario's faults strike.

The simulator counts what its board samples, tick by tick; the recording says what it stored and what it
counted as lost. Both are programs of their own, so that nothing but the line connects them.
"""

import contextlib
import json
import socket
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomli_w
from impid_host.recording.reader import Recording, read_recording

from hil_sim.scenarios.load import SHIPPED

RECORD = [sys.executable, "-c", "from impid_host.cli import main; main()", "record"]
SERVE = [sys.executable, "-c", "from hil_sim.cli import main; main()", "serve"]
LEAD_S = 0.25  # from START to the motion, from which faults count
AFTER_S = 1.2  # recorded behind the last fault


@dataclass(frozen=True)
class Outcome:
    """A recording and the simulator's last line beside it.

    Attributes:
        recording: as read back from the file.
        closed: the simulator's book: boots, faults, lag.
        exit_code, said: of the recorder.
    """

    recording: Recording
    closed: dict[str, Any]
    exit_code: int
    said: str

    @property
    def books(self) -> list[dict[str, Any]]:
        """Boot by boot: produced as the simulator counted, stored, lost, and what nobody could count."""
        books = []
        for boot in self.closed["boots"]:
            ledgers = [each for each in self.recording.ledgers if each.boot_id == boot["boot_id"]]
            books.append(
                {
                    "boot": boot["boot_id"],
                    "cause": boot["reset_cause"],
                    "produced": boot["samples_produced"],
                    "stored": sum(each.stored + each.surplus for each in ledgers),
                    "lost": sum(each.lost for each in ledgers),
                    "uncounted": sum(each.uncounted or 0 for each in ledgers),
                }
            )
        return books

    @property
    def balanced(self) -> bool:
        """Exactly where the board could count; within the recording's own bound where power was lost."""
        return all(
            0 <= book["produced"] - book["stored"] - book["lost"] <= book["uncounted"] for book in self.books
        )

    @property
    def resumed_ms(self) -> list[float]:
        """For each fault that ends, how long after its end (or after the boot) the first sample is from."""
        return [
            after
            for fault in self.closed["faults"]
            for after in [self._resumed_ms(fault)]
            if after is not None
        ]

    def _resumed_ms(self, fault: dict[str, Any]) -> float | None:
        if fault["kind"] in ("watchdog", "brown_out", "board_reset"):
            later = [s for s in self.recording.segments if s.boot_id > fault["begin"]["boot_id"]]
            return float(later[0].samples.t_us[0]) / 1000 if later else None
        if not fault.get("end"):
            return None
        end_us, boot = fault["end"]["board_us"], fault["end"]["boot_id"]
        for segment in self.recording.segments:
            if segment.boot_id == boot:
                after = segment.samples.t_us[segment.samples.t_us >= end_us]
                if after.size:
                    return (float(after[0]) - end_us) / 1000
        return None


def free_port() -> int:
    """A port that nobody uses."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("", 0))
        return int(free.getsockname()[1])


def record_through(
    carrier: str, faults: list[dict[str, Any]], folder: Path, *, at_least_s: float = 0.0
) -> Outcome:
    """Record until a second behind the last fault, and hold the books against each other."""
    content = tomllib.loads((SHIPPED / "first-light.toml").read_text(encoding="utf-8"))
    last_s = max((fault["at_s"] + fault.get("duration_s", 0.0) for fault in faults), default=0.0)
    for trial in content["trials"]:
        trial["duration_s"] = last_s + 60.0
    content["faults"] = faults
    scenario, link, out = folder / "faulty.toml", folder / "tty", folder / "faulty.mcap"
    scenario.write_text(tomli_w.dumps(content), encoding="utf-8")
    how = ["--carrier", carrier]
    if carrier in ("pty", "slcan"):
        how += ["--link", str(link)]
    elif carrier == "udp_multicast":
        how += ["--address", f"239.74.163.2:{free_port()}"]
    simulator = subprocess.Popen(
        [*SERVE, str(scenario), *how], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert simulator.stdout is not None
    try:
        ready = json.loads(simulator.stdout.readline())
        place = {
            "pty": ["--port", str(link)],
            "tcp": ["--port", str(ready["port"])],
            "slcan": ["--can", f"slcan:{link}"],
        }.get(carrier) or ["--can", f"{ready['can']},port={ready['can_config']['port']}"]
        seconds = max(at_least_s, LEAD_S + last_s + AFTER_S)
        recorder = subprocess.run(
            [*RECORD, *place, "--duration", f"{seconds:g}", "--out", str(out)],
            capture_output=True,
            text=True,
            timeout=seconds * 5 + 120,
            check=False,
        )
        simulator.terminate()
        said, _ = simulator.communicate(timeout=60)
    finally:
        with contextlib.suppress(ProcessLookupError):
            simulator.kill()
        simulator.wait()
    events = [json.loads(line) for line in said.splitlines()]
    closed = next(event for event in events if event["event"] == "closed")
    return Outcome(read_recording(out), closed, recorder.returncode, recorder.stdout + recorder.stderr)
