"""What a recording contains: topics, their schemas, and the names of its metadata.

`/wire` (on CAN `/can`) is the truth: every byte that came in or went out, with its stamps, and the clock
exchanges; `/events` are the recorder's notes. Both are flushed together. `/samples`, `/status` and
`/clock` are there for looking, in chunks of their own that a reader of this package passes over. All but
the events are protobuf with the schema embedded, so Foxglove, PlotJuggler and the bare `mcap` library
read them."""

import json
from dataclasses import dataclass, fields
from typing import Any

from impid_host.recording.protobuf import (
    BYTES,
    SINT32,
    UINT32,
    UINT64,
    Field,
    file_descriptor_set,
    numbered,
)
from impid_host.wire.records import BoardStatus

PROFILE = "impid-recording/2"
OLD_PROFILE = "impid-recording/1"
METADATA_HOST = "impid.host"
METADATA_BOARD = "impid.board"
METADATA_SETTINGS = "impid.settings"
METADATA_CALIBRATION = "impid.calibration"
METADATA_SUMMARY = "impid.summary"


@dataclass(frozen=True, slots=True)
class Topic:
    """One channel of the file; its number is that of its schema as well."""

    name: str
    number: int
    schema: str
    schema_encoding: str
    schema_data: bytes
    encoding: str


def _protobuf(name: str, number: int, message: str, told: dict[str, Field]) -> Topic:
    schema = file_descriptor_set(message, told)
    return Topic(name, number, f"impid.{message}", "protobuf", schema, "protobuf")


WIRE_FIELDS = numbered(
    [
        (name, BYTES)
        for name in (
            "rx_calls",
            "rx_rows",
            "rx_bytes",
            "tx_calls",
            "tx_rows",
            "tx_bytes",
            "exchanges",
            "position",
        )
    ]
)
_SENSOR = ("ax", UINT32), ("ay", UINT32), ("az", UINT32), ("enc1", SINT32), ("enc2", SINT32)
SAMPLE_FIELDS = numbered(
    [("boot_id", UINT32), ("run", UINT32), ("index", UINT64), ("t_us", UINT64), *_SENSOR, ("flags", UINT32)]
)
STEP_FIELDS = {
    **{f"{name}_steps": Field(20 + n, SINT32, repeated=True) for n, (name, _) in enumerate(_SENSOR)},
    "flags_rest": Field(30, UINT32, repeated=True),
}
STATUS_FIELDS = numbered([(f.name, UINT64) for f in fields(BoardStatus)])
CLOCK_FIELDS = numbered(
    [("boot_id", UINT32), ("t1_ns", UINT64), ("t2_us", UINT64), ("t3_us", UINT64), ("t4_ns", UINT64)]
)
EVENT_NAMES = "start, stop, loss, run, boot, disconnected, reconnected, wall-clock-set, mark, enough"
_EVENT: dict[str, Any] = {
    "type": "object",
    "title": "impid.Event",
    "properties": {
        "event": {"type": "string", "description": EVENT_NAMES},
        "monotonic_ns": {"type": "integer"},
        "wall_ns": {"type": "integer"},
        "detail": {"type": "object"},
    },
}

WIRE = _protobuf("/wire", 1, "Wire", WIRE_FIELDS)
CAN_WIRE = _protobuf("/can", 6, "Wire", WIRE_FIELDS)
WIRES = {"serial": WIRE, "can": CAN_WIRE}
EVENTS = Topic("/events", 2, "impid.Event", "jsonschema", json.dumps(_EVENT).encode(), "json")
SAMPLES = _protobuf("/samples", 3, "Samples", SAMPLE_FIELDS | STEP_FIELDS)
STATUS = _protobuf("/status", 4, "Status", STATUS_FIELDS)
CLOCK = _protobuf("/clock", 5, "ClockExchange", CLOCK_FIELDS)
# For looking: what they show is in the truth as well.
LOOKS = (SAMPLES, STATUS, CLOCK)

# Topics of the first profile, which were all JSON.
OLD_RX, OLD_CAN_RX, OLD_CLOCK = "/wire/rx", "/can/rx", "/clock"
OLD_LOOKS = ("/wire/tx", "/can/tx", "/samples", "/status")
