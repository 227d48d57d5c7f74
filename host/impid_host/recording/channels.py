"""What a recording contains: topics, their JSON schemas, and the names of its metadata.

Every channel is JSON with its schema embedded, so Foxglove, PlotJuggler and the bare `mcap` library read it.
The raw bytes (`/wire/rx`, `/wire/tx`; on CAN `/can/rx`, `/can/tx`) are the truth; samples and statuses are
there for looking, and a reader of this package decodes the raw bytes anew.
"""

import json
from dataclasses import dataclass, fields
from typing import Any

from impid_host.wire.records import BoardStatus

PROFILE = "impid-recording/1"
METADATA_HOST = "impid.host"
METADATA_BOARD = "impid.board"
METADATA_SETTINGS = "impid.settings"
METADATA_CALIBRATION = "impid.calibration"
METADATA_SUMMARY = "impid.summary"


@dataclass(frozen=True, slots=True)
class Topic:
    """One channel of the file."""

    name: str
    schema: str
    properties: dict[str, dict[str, Any]]

    def schema_json(self) -> bytes:
        """The JSON schema as the file embeds it."""
        return json.dumps({"type": "object", "title": self.schema, "properties": self.properties}).encode()


def _integers(*names: str) -> dict[str, dict[str, Any]]:
    return {name: {"type": "integer"} for name in names}


_WIRE = {
    "monotonic_ns": {
        "type": "integer",
        "description": "host monotonic clock when the call returned or began",
    },
    "wall_ns": {"type": "integer", "description": "host wall clock at the same moment, ns since 1970"},
    "data": {"type": "string", "contentEncoding": "base64", "description": "bytes of the serial line"},
}
RX = Topic("/wire/rx", "impid.WireBytes", _WIRE)
TX = Topic("/wire/tx", "impid.WireBytes", _WIRE)
_FRAMES = _WIRE | {
    "data": {
        "type": "string",
        "contentEncoding": "base64",
        "description": "CAN frames, 24 bytes each, little-endian: u64 monotonic_ns, u32 identifier (bit 31 "
        "extended, 30 remote, 29 error), u8 dlc, 3 zero bytes, 8 data bytes",
    }
}
CAN_RX = Topic("/can/rx", "impid.CanFrames", _FRAMES)
CAN_TX = Topic("/can/tx", "impid.CanFrames", _FRAMES)
WIRES = {"serial": (RX, TX), "can": (CAN_RX, CAN_TX)}  # carrier -> received, sent
SAMPLES = Topic(
    "/samples",
    "impid.Sample",
    _integers("boot_id", "run", "index")
    | {
        "t_us": {"type": "integer", "description": "us since the board's boot, group delay taken off"},
        "ax": {"type": "integer", "description": "code of the accelerometer, 16 or 24 bits"},
        "ay": {"type": "integer", "description": "code of the accelerometer, 16 or 24 bits"},
        "az": {"type": "integer", "description": "the same of a third axis, where the sensor has one"},
        "enc1": {"type": "integer", "description": "counter"},
        "enc2": {"type": "integer", "description": "counter"},
        "flags": {
            "type": "integer",
            "description": "bit 0 saturated, 1 encoder fault, 2 late, 3 reset before, 4 sync edge",
        },
    },
)
STATUS = Topic("/status", "impid.Status", _integers(*(f.name for f in fields(BoardStatus))))
CLOCK = Topic(
    "/clock",
    "impid.ClockExchange",
    _integers("boot_id")
    | {
        "t1_ns": {"type": "integer", "description": "ping sent, host monotonic clock"},
        "t2_us": {"type": "integer", "description": "ping received, board clock"},
        "t3_us": {"type": "integer", "description": "answer sent, board clock"},
        "t4_ns": {"type": "integer", "description": "answer received, host monotonic clock"},
    },
)
EVENT_NAMES = "start, stop, loss, run, boot, disconnected, reconnected, wall-clock-set, mark, enough"
EVENTS = Topic(
    "/events",
    "impid.Event",
    {
        "event": {"type": "string", "description": EVENT_NAMES},
        "monotonic_ns": {"type": "integer"},
        "wall_ns": {"type": "integer"},
        "detail": {"type": "object"},
    },
)
DECODED = (SAMPLES, STATUS, CLOCK, EVENTS)
