"""MCAP records as bytes, and the index that closes a file (the format's specification, version 0).

The index is kept as the bytes that it will be: 24 hours of recording make 80 MB of it.
"""

import struct
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import zstandard

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END = 11, 12, 13, 14, 15
HEAD = struct.Struct("<BQ")  # opcode, length of the body
CHUNK_HEAD = struct.Struct("<QQQI")  # first and last log time, size and checksum of what is in it
MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence, log time, time of publication
COMPRESSION = "zstd"
# Higher levels cost processor time while recording and gain a few parts in a hundred.
_LEVEL = 3

Values = Mapping[str, str]


def record(opcode: int, body: bytes) -> bytes:
    """One record."""
    return HEAD.pack(opcode, len(body)) + body


def text(content: str) -> bytes:
    """A string as the format writes it."""
    encoded = content.encode()
    return struct.pack("<I", len(encoded)) + encoded


def header(profile: str, library: str) -> bytes:
    """Magic and header."""
    return MAGIC + record(HEADER, text(profile) + text(library))


def schema(number: int, name: str, encoding: str, data: bytes) -> bytes:
    """A schema record; numbers begin at 1."""
    body = struct.pack("<H", number) + text(name) + text(encoding) + struct.pack("<I", len(data)) + data
    return record(SCHEMA, body)


def channel(number: int, schema_number: int, topic: str, encoding: str) -> bytes:
    """A channel record."""
    return record(
        CHANNEL, struct.pack("<HH", number, schema_number) + text(topic) + text(encoding) + _map({})
    )


def metadata(name: str, values: Values) -> bytes:
    """A metadata record."""
    return record(METADATA, text(name) + _map(values))


@dataclass(frozen=True, slots=True)
class Message:
    """A message of a chunk to be."""

    channel: int
    sequence: int
    log_ns: int
    data: bytes


@dataclass(frozen=True, slots=True)
class Chunk:
    """A chunk as bytes: its record and behind it the message indexes.

    Attributes:
        data: all of it.
        length: of the chunk's record alone.
        start_ns, end_ns: first and last log time.
        compressed, uncompressed: bytes of the messages in the file and before.
        indexes: channel -> where its message index begins, from the beginning of `data`.
        counts: channel -> messages.
    """

    data: bytes
    length: int
    start_ns: int
    end_ns: int
    compressed: int
    uncompressed: int
    indexes: dict[int, int]
    counts: dict[int, int]

    @classmethod
    def of(cls, messages: Sequence[Message]) -> "Chunk":
        """At least one message, in order of log time within each channel."""
        content = bytearray()
        entries: dict[int, bytearray] = {}
        for m in messages:
            entries.setdefault(m.channel, bytearray()).extend(struct.pack("<QQ", m.log_ns, len(content)))
            content += HEAD.pack(MESSAGE, MESSAGE_HEAD.size + len(m.data))
            content += MESSAGE_HEAD.pack(m.channel, m.sequence, m.log_ns, m.log_ns) + m.data
        packed = zstandard.ZstdCompressor(level=_LEVEL, write_checksum=False).compress(bytes(content))
        times = [m.log_ns for m in messages]
        head = CHUNK_HEAD.pack(min(times), max(times), len(content), zlib.crc32(content))
        body = head + text(COMPRESSION) + struct.pack("<Q", len(packed)) + packed
        data = bytearray(record(CHUNK, body))
        length, indexes = len(data), {}
        for number, entry in entries.items():
            indexes[number] = len(data)
            data += record(MESSAGE_INDEX, struct.pack("<HI", number, len(entry)) + entry)
        counts = {number: len(entry) // 16 for number, entry in entries.items()}
        return cls(bytes(data), length, min(times), max(times), len(packed), len(content), indexes, counts)


@dataclass(slots=True)
class Index:
    """What a file holds, collected while it is written."""

    schemas: Sequence[bytes]  # records, which are repeated at the end
    channels: Sequence[bytes]
    _chunks: bytearray = field(default_factory=bytearray)
    _chunk_count: int = 0
    _metadata: bytearray = field(default_factory=bytearray)
    _metadata_count: int = 0
    _counts: dict[int, int] = field(default_factory=dict)
    _span_ns: tuple[int, int] | None = None

    def chunk(self, chunk: Chunk, at: int) -> None:
        """A chunk stands at that byte."""
        offsets = b"".join(struct.pack("<HQ", n, at + where) for n, where in chunk.indexes.items())
        body = struct.pack("<QQQQI", chunk.start_ns, chunk.end_ns, at, chunk.length, len(offsets)) + offsets
        body += struct.pack("<Q", len(chunk.data) - chunk.length) + text(COMPRESSION)
        self._chunks += record(CHUNK_INDEX, body + struct.pack("<QQ", chunk.compressed, chunk.uncompressed))
        self._chunk_count += 1
        for number, count in chunk.counts.items():
            self._counts[number] = self._counts.get(number, 0) + count
        first, last = self._span_ns or (chunk.start_ns, chunk.end_ns)
        self._span_ns = min(first, chunk.start_ns), max(last, chunk.end_ns)

    def metadata(self, name: str, data: bytes, at: int) -> None:
        """A metadata record stands at that byte."""
        self._metadata += record(METADATA_INDEX, struct.pack("<QQ", at, len(data)) + text(name))
        self._metadata_count += 1

    def closing(self, at: int) -> bytes:
        """Everything from the end of the data to the end of the file, which begins at that byte."""
        end = record(DATA_END, struct.pack("<I", 0))
        groups = [
            (SCHEMA, b"".join(self.schemas)),
            (CHANNEL, b"".join(self.channels)),
            (STATISTICS, self._statistics()),
            (CHUNK_INDEX, bytes(self._chunks)),
            (METADATA_INDEX, bytes(self._metadata)),
        ]
        start = place = at + len(end)
        summary, offsets = bytearray(), bytearray()
        for opcode, group in groups:
            if group:
                offsets += record(SUMMARY_OFFSET, struct.pack("<BQQ", opcode, place, len(group)))
                summary += group
                place += len(group)
        summary += offsets
        foot = HEAD.pack(FOOTER, 20) + struct.pack("<QQ", start, place)
        checksum = zlib.crc32(foot, zlib.crc32(summary))
        return end + bytes(summary) + foot + struct.pack("<I", checksum) + MAGIC

    def _statistics(self) -> bytes:
        first, last = self._span_ns or (0, 0)
        counts = b"".join(struct.pack("<HQ", number, count) for number, count in sorted(self._counts.items()))
        numbers = (
            sum(self._counts.values()),
            len(self.schemas),
            len(self.channels),
            0,
            self._metadata_count,
            self._chunk_count,
        )
        body = struct.pack("<QHIIIIQQ", *numbers, first, last) + struct.pack("<I", len(counts)) + counts
        return record(STATISTICS, body)


def _map(values: Values) -> bytes:
    content = b"".join(text(key) + text(value) for key, value in values.items())
    return struct.pack("<I", len(content)) + content
