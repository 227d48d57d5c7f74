"""The writer of the first format of recordings, as it was: such files must be read for ever.

All channels were JSON, one message a sample, the raw bytes in base64, everything in one zstd chunk each
20 ms."""

import base64
import json
from dataclasses import asdict, fields
from pathlib import Path

from impid_host.clock.device import ClockExchange
from impid_host.link.link import Chunk
from impid_host.wire.records import BoardStatus, Segment
from mcap.writer import CompressionType, Writer

_WIRE = ("monotonic_ns", "wall_ns", "data")
_TOPICS = {
    "/samples": (
        "impid.Sample",
        ("boot_id", "run", "index", "t_us", "ax", "ay", "az", "enc1", "enc2", "flags"),
    ),
    "/status": ("impid.Status", tuple(f.name for f in fields(BoardStatus))),
    "/clock": ("impid.ClockExchange", ("boot_id", "t1_ns", "t2_us", "t3_us", "t4_ns")),
    "/events": ("impid.Event", ("event", "monotonic_ns", "wall_ns", "detail")),
}
_WIRES = {
    "serial": {"/wire/rx": ("impid.WireBytes", _WIRE), "/wire/tx": ("impid.WireBytes", _WIRE)},
    "can": {"/can/rx": ("impid.CanFrames", _WIRE), "/can/tx": ("impid.CanFrames", _WIRE)},
}
_OFFSET_NS = 1_700_000_000 * 10**9  # wall minus monotonic clock


class FirstFormatWriter:
    """Writes what the recorder of that time wrote."""

    def __init__(self, path: Path, metadata: dict[str, dict[str, str]], carrier: str = "serial") -> None:
        self._file = path.open("wb")
        self._mcap = Writer(self._file, chunk_size=4 << 20, compression=CompressionType.ZSTD)
        self._mcap.start(profile="impid-recording/1", library="impid-host 0")
        for name, values in metadata.items():
            self._mcap.add_metadata(name, values)
        self._channel = {}
        self._rx, self._tx = _WIRES[carrier]
        for topic, (title, names) in (_WIRES[carrier] | _TOPICS).items():
            schema = {"type": "object", "title": title, "properties": {name: {} for name in names}}
            number = self._mcap.register_schema(title, "jsonschema", json.dumps(schema).encode())
            self._channel[topic] = self._mcap.register_channel(topic, "json", number)
        self.flush()

    def received(self, chunk: Chunk) -> None:
        self._wire(self._rx, chunk)

    def sent(self, chunk: Chunk) -> None:
        self._wire(self._tx, chunk)

    def samples(self, segment: Segment, received_ns: int) -> None:
        s = segment.samples
        names = ["t_us", "ax", "ay", *(["az"] if s.az is not None else []), "enc1", "enc2", "flags"]
        rows = zip(segment.index.tolist(), *(getattr(s, name).tolist() for name in names), strict=True)
        for row in rows:
            body = {"boot_id": segment.boot_id, "run": segment.run} | dict(
                zip(["index", *names], row, strict=True)
            )
            self._json("/samples", received_ns, body)

    def status(self, status: BoardStatus, received_ns: int) -> None:
        told = {name: value for name, value in asdict(status).items() if value is not None}
        self._json("/status", received_ns, told)

    def exchange(self, exchange: ClockExchange, boot_id: int) -> None:
        self._json("/clock", exchange.t4_ns, {"boot_id": boot_id, **asdict(exchange)})

    def event(self, name: str, **detail: object) -> None:
        now = Chunk.now(b"")
        body = {"event": name, "monotonic_ns": now.monotonic_ns, "wall_ns": now.wall_ns, "detail": detail}
        self._json("/events", now.monotonic_ns, body)

    def flush(self) -> None:
        self._mcap.flush()

    def close(self, summary: dict[str, str]) -> None:
        self._mcap.add_metadata("impid.summary", summary)
        self._mcap.finish()
        self._file.close()

    def _wire(self, topic: str, chunk: Chunk) -> None:
        data = base64.b64encode(chunk.data).decode("ascii")
        body = {"monotonic_ns": chunk.monotonic_ns, "wall_ns": chunk.wall_ns, "data": data}
        self._json(topic, chunk.monotonic_ns, body)

    def _json(self, topic: str, monotonic_ns: int, body: dict[str, object]) -> None:
        at = monotonic_ns + _OFFSET_NS
        self._mcap.add_message(self._channel[topic], at, json.dumps(body).encode(), at)
