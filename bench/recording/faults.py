"""Every fault of the line, the bus and the board, one at a time over every carrier that can have it.

`faults.py [CARRIER...]`. The simulator counts what its board samples; each boot's count must be what the
recording stored plus what it counted as lost, to the sample. Where power was lost, the board's own count is
gone, and the recording's bound must hold.
"""

import sys
import tempfile
from pathlib import Path
from typing import Any

from common import save

from tests.host.recording.served import record_through

AT = 0.6
LINE = (
    {"kind": "bit_errors", "duration_s": 1.5, "rate": 2e-4},
    {"kind": "bit_errors", "duration_s": 1.5, "rate": 2e-3, "direction": "to_board"},
    {"kind": "dropped_bytes", "duration_s": 1.5, "rate": 2e-3},
    {"kind": "duplicated_bytes", "duration_s": 1.5, "rate": 2e-3},
)
BUS = (
    {"kind": "dropped_frames", "duration_s": 1.5, "rate": 0.05},
    {"kind": "duplicated_frames", "duration_s": 1.5, "rate": 0.05},
    {"kind": "bus_off", "duration_s": 0.3},
    {"kind": "bus_off", "duration_s": 2.5},
)
ANY = (
    {"kind": "line_stall", "duration_s": 0.7},
    {"kind": "line_stall", "duration_s": 2.0},
    {"kind": "slow_reader", "duration_s": 1.0, "bytes_per_s": 4000.0, "buffer_bytes": 2000},
    {"kind": "cable_pulled", "duration_s": 1.0},
    {"kind": "main_loop_stall", "duration_s": 0.4},
    {"kind": "board_reset"},
    {"kind": "watchdog", "duration_s": 0.1},
    {"kind": "brown_out", "duration_s": 0.3},
    {"kind": "adc_saturation", "duration_s": 0.5},
    {"kind": "encoder_lost", "duration_s": 0.5, "encoder": 1},
)
FAULTS: dict[str, tuple[dict[str, Any], ...]] = {
    "pty": LINE + ANY,
    "tcp": LINE + ANY,
    "slcan": LINE[2:]
    + BUS
    + ANY,  # a flipped bit is a wrong frame there: the adapter's protocol has no checksum
    "udp_multicast": BUS + ANY,
}


def run(carrier: str, fault: dict[str, Any], folder: Path) -> dict[str, Any]:
    outcome = record_through(carrier, [{"at_s": AT, **fault}], folder)
    return {
        "fault": fault,
        "books": outcome.books,
        "balanced": outcome.balanced,
        "resumed_ms": outcome.resumed_ms,
        "exit_code": outcome.exit_code,
        "lag_s": outcome.closed["lag"]["worst_s"],
        "said": outcome.said.strip().splitlines()[-1],
        "faults": outcome.closed["faults"],
    }


def main(*carriers: str) -> None:
    for carrier in carriers or tuple(FAULTS):
        found = []
        for fault in FAULTS[carrier]:
            with tempfile.TemporaryDirectory() as folder:
                try:
                    found.append(run(carrier, fault, Path(folder)))
                except Exception as error:  # the table shows it as what it is: not passed
                    found.append({"fault": fault, "balanced": False, "failed": repr(error)})
            last = found[-1]
            print(
                carrier,
                fault,
                last["balanced"],
                last.get("books"),
                last.get("resumed_ms"),
                last.get("failed"),
            )
        save(f"faults_{carrier}", carrier=carrier, runs=found)


if __name__ == "__main__":
    main(*sys.argv[1:])
