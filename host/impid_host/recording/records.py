"""The records of a recording's file in order, whatever has happened to the file.

Damage costs the records that it touches: behind it the reading goes on at the next record that is whole,
which is a chunk whose checksum holds. A cut-off file ends with what could not be read any more. Chunks
that hold nothing but what is for looking are passed over unopened."""

import mmap
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from math import isinf
from pathlib import Path
from typing import NamedTuple

import zstandard

from impid_host.errors import InputError
from impid_host.recording import channels, container

# A chunk holds 100 ms, a few kB; anything far larger is damage and must not fill the memory.
_LARGEST_RECORD_BYTES = 64 << 20
_DAMAGE = (struct.error, ValueError, OverflowError, MemoryError, zstandard.ZstdError)
_CHUNK = bytes([container.CHUNK])
_CHUNK_HEAD = struct.Struct(container.CHUNK_HEAD.format + "I")  # and the length of the compression's name
_U64 = struct.Struct("<Q")
_NOT_OURS = "give a file that `impid-host record` has written"
_NS = 1_000_000_000
_NEVER_NS = 1 << 64  # behind every log time
# A date on CAN comes ten times a second, and a frame may have begun in the chunk before.
_LEAD_NS = _NS // 2
# Chunks for looking begin up to a second and some before those of the wire beside them.
_SLACK_NS = 3 * _NS
_HALVE_UNTIL_BYTES = 1 << 18
# Pages that were read are given back every so often.
_RELEASE_BYTES = 16 << 20


class Message(NamedTuple):
    """A message: its topic (None where no channel describes it), its content, and the first log time of
    its chunk, s since that of the first chunk."""

    topic: str | None
    data: bytes
    at_s: float


class Metadata(NamedTuple):
    """Named texts."""

    name: str
    values: dict[str, str]


class Window(NamedTuple):
    """Seconds since the recording's first byte, on the host's clock."""

    start_s: float
    stop_s: float


@dataclass(slots=True)
class RecordFile:
    """An open recording.

    Attributes:
        path: the file.
        profile: which format it is.
        warnings: what is damaged or missing, added to while it is read.
    """

    path: Path
    profile: str
    warnings: list[str]
    _data: mmap.mmap
    _body: int
    _topics: dict[int, str]
    _origin_ns: int | None = None
    _unopener: zstandard.ZstdDecompressor = field(default_factory=zstandard.ZstdDecompressor)

    def items(self, window: Window | None = None) -> Iterator[Message | Metadata]:
        """Messages and metadata in order. Of a window: the metadata at the beginning of the file, then
        what was recorded from half a second before the window to the first chunk behind it."""
        first = self._next_chunk(self._body)
        self._origin_ns = None if first is None else self._start_ns(first)
        if window is None or self._origin_ns is None or first is None:
            yield from self._run(self._body, len(self._data))
            return
        yield from self._run(self._body, first)
        if self.profile == channels.OLD_PROFILE:  # it described its channels in the first chunk
            for _ in self._open(first, self._behind(first) or len(self._data)):
                pass
        start_ns = self._origin_ns + round(window.start_s * _NS) - _LEAD_NS
        stop_ns = None if isinf(window.stop_s) else self._origin_ns + round(window.stop_s * _NS)
        yield from self._run(self._seek(first, start_ns - _SLACK_NS), len(self._data), start_ns, stop_ns)

    def metadata(self) -> Iterator[Metadata]:
        """The metadata alone: no chunk is opened."""
        for item in self._run(self._body, len(self._data), start_ns=_NEVER_NS):
            if isinstance(item, Metadata):
                yield item

    def _run(
        self, at: int, end: int, start_ns: int = 0, stop_ns: int | None = None
    ) -> Iterator[Message | Metadata]:
        released = at
        while at < end:
            behind = self._behind(at)
            if behind is None:
                resumed = self._next_chunk(at + 1)
                if resumed is None:
                    break
                self.warnings.append(f"{self.path}: bytes {at} to {resumed - 1} are damaged and are skipped")
                at = resumed
                continue
            try:
                if self._data[at] in (container.DATA_END, container.FOOTER):
                    return  # an index follows, for readers that want one
                yield from self._record(at, behind, start_ns)
            except _DAMAGE:
                self.warnings.append(f"{self.path}: a chunk before byte {behind} is damaged and is skipped")
            if stop_ns is not None and self._data[at] == container.CHUNK and self._start_ns(at) > stop_ns:
                return
            at = behind
            if at - released > _RELEASE_BYTES:
                _release(self._data, released, at)
                released = at
        if end == len(self._data):
            self.warnings.append(
                f"{self.path}: was cut off (power cut, crash or full disk): up to 0.1 s before its end is "
                f"missing, and {len(self._data) - at} of its {len(self._data)} bytes are an incomplete record"
            )

    def _record(self, at: int, behind: int, start_ns: int) -> Iterator[Message | Metadata]:
        opcode, body = self._data[at], at + container.HEAD.size
        if opcode == container.CHUNK:
            if self._start_ns(at) >= start_ns and not self._only_looks(behind):
                yield from self._open(at, behind)
        elif opcode == container.METADATA:
            yield _metadata(self._data[body:behind])

    def _behind(self, at: int) -> int | None:
        """Where the record that begins there ends; None if it makes no sense."""
        if at + container.HEAD.size > len(self._data):
            return None
        opcode, length = container.HEAD.unpack_from(self._data, at)
        end = at + container.HEAD.size + length
        if not container.HEADER <= opcode <= container.DATA_END or length > _LARGEST_RECORD_BYTES:
            return None
        if end > len(self._data) or (opcode == container.CHUNK and not self._is_filled(at, end)):
            return None
        return int(end)

    def _is_filled(self, at: int, end: int) -> bool:
        """Whether the parts of a chunk fill it: else its length is damaged, or it is none."""
        start = at + container.HEAD.size
        if start + _CHUNK_HEAD.size > end:
            return False
        name_length = _CHUNK_HEAD.unpack_from(self._data, start)[4]
        start += _CHUNK_HEAD.size + name_length + _U64.size
        return bool(
            name_length <= 4 and start <= end and end - start == _U64.unpack_from(self._data, start - 8)[0]
        )

    def _parts(self, at: int, end: int) -> tuple[int, int, bytes]:
        """Size and checksum of what a chunk holds, and its compressed content.

        Raises:
            ValueError, zstandard.ZstdError: it is damaged.
        """
        _, _, size, checksum, name_length = _CHUNK_HEAD.unpack_from(self._data, at + container.HEAD.size)
        start = at + container.HEAD.size + _CHUNK_HEAD.size + name_length + _U64.size
        packed = self._data[start:end]
        if packed[:4] == zstandard.FRAME_HEADER:
            size_inside = zstandard.frame_content_size(packed)
        else:
            size_inside = len(packed)
        # Opening it must not fill the memory, whatever stands in it.
        if max(size, size_inside) > _LARGEST_RECORD_BYTES:
            raise ValueError("it holds more than any chunk")
        return size, checksum, packed

    def _content(self, at: int, end: int) -> bytes:
        """What a chunk holds.

        Raises:
            ValueError, zstandard.ZstdError: it is damaged.
        """
        size, checksum, packed = self._parts(at, end)
        plain = packed[:4] != zstandard.FRAME_HEADER
        content = packed if plain else self._unopener.decompress(packed, max_output_size=size)
        if len(content) != size or zlib.crc32(content) != checksum:
            raise ValueError("the checksum does not hold")
        return content

    def _open(self, at: int, end: int) -> Iterator[Message]:
        content = self._content(at, end)
        at_s = (self._start_ns(at) - (self._origin_ns or 0)) / _NS
        place, head = 0, container.HEAD.size
        while place < len(content):
            opcode, length = container.HEAD.unpack_from(content, place)
            body, place = place + head, place + head + length
            if place > len(content):
                raise ValueError("a record reaches beyond its chunk")
            if opcode == container.MESSAGE:
                number = content[body] | content[body + 1] << 8
                data = content[body + container.MESSAGE_HEAD.size : place]
                yield Message(self._topics.get(number), data, at_s)
            elif opcode == container.CHANNEL and self.profile == channels.OLD_PROFILE:
                self._channel(content[body:place])

    def _channel(self, body: bytes) -> None:
        (number,) = struct.unpack_from("<H", body)
        self._topics[number] = _text(body, 4)[0]

    def _only_looks(self, at: int) -> bool:
        """Whether the message indexes that follow a chunk name nothing but topics for looking."""
        known = False
        head = container.HEAD.size
        while at + head + 2 <= len(self._data) and self._data[at] == container.MESSAGE_INDEX:
            number = self._data[at + head] | self._data[at + head + 1] << 8
            if self._topics.get(number) not in _PASSED_OVER[self.profile]:
                return False
            known = True
            at += head + int(container.HEAD.unpack_from(self._data, at)[1])
        return known

    def _start_ns(self, at: int) -> int:
        """First log time of the chunk that begins there."""
        return int(container.CHUNK_HEAD.unpack_from(self._data, at + container.HEAD.size)[0])

    def _seek(self, first: int, wanted_ns: int) -> int:
        """A chunk that begins before the wanted time and not long before, by halving the file."""
        low, high = first, len(self._data)
        while high - low > _HALVE_UNTIL_BYTES:
            middle = self._next_chunk((low + high) // 2)
            if middle is None or middle >= high or self._start_ns(middle) >= wanted_ns:
                high = (low + high) // 2
            else:
                low = middle
        return low

    def _next_chunk(self, at: int) -> int | None:
        """Where the next chunk whose checksum holds begins."""
        while (at := self._data.find(_CHUNK, at)) >= 0:
            behind = self._behind(at)
            if behind is not None:
                with suppress(*_DAMAGE):
                    if self._content(at, behind):
                        return at
            at += 1
        return None


_PASSED_OVER = {
    channels.PROFILE: frozenset(topic.name for topic in channels.LOOKS),
    channels.OLD_PROFILE: frozenset(channels.OLD_LOOKS),
}


@contextmanager
def open_records(path: Path, warnings: list[str]) -> Iterator[RecordFile]:
    """A recording of either format; what is damaged or missing is added to the warnings.

    Raises:
        InputError: no such file, or not a recording of impid.
    """
    try:
        if not path.stat().st_size:  # cannot be mapped
            raise InputError(path, "is not an MCAP file", _NOT_OURS)
        with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            profile, body = _header(path, data)
            # The numbers are always these, so a damaged description costs nothing.
            topics = {} if profile == channels.OLD_PROFILE else _NUMBERS.copy()
            yield RecordFile(path, profile, warnings, data, body, topics)
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check the name") from None


_NUMBERS = {t.number: t.name for t in (*channels.WIRES.values(), channels.EVENTS, *channels.LOOKS)}


def _header(path: Path, data: mmap.mmap) -> tuple[str, int]:
    """The profile, and where the records behind the header begin."""
    start = len(container.MAGIC)
    try:
        opcode, length = container.HEAD.unpack_from(data, start)
        body = data[start + container.HEAD.size : start + container.HEAD.size + length]
        if data[:start] != container.MAGIC or opcode != container.HEADER or len(body) != length:
            raise ValueError("no header")
        profile = _text(body, 0)[0]
    except _DAMAGE:
        raise InputError(path, "is not an MCAP file", _NOT_OURS) from None
    if profile not in _PASSED_OVER:
        raise InputError(path, "is an MCAP file, but not a recording of impid", _NOT_OURS)
    return profile, start + container.HEAD.size + len(body)


def _text(body: bytes, at: int) -> tuple[str, int]:
    """A string and where it ends."""
    (length,) = struct.unpack_from("<I", body, at)
    if at + 4 + length > len(body):
        raise ValueError("a text reaches beyond its record")
    return body[at + 4 : at + 4 + length].decode(), at + 4 + length


def _metadata(body: bytes) -> Metadata:
    name, at = _text(body, 0)
    (length,) = struct.unpack_from("<I", body, at)
    at, values = at + 4, {}
    if at + length > len(body):
        raise ValueError("a map reaches beyond its record")
    end = at + length
    while at < end:
        key, at = _text(body, at)
        values[key], at = _text(body, at)
    return Metadata(name, values)


def _release(data: mmap.mmap, start: int, stop: int) -> None:
    """Let go of pages of the file that were read: a long file must not fill the memory."""
    if hasattr(data, "madvise"):
        first, last = start // mmap.PAGESIZE * mmap.PAGESIZE, stop // mmap.PAGESIZE * mmap.PAGESIZE
        data.madvise(mmap.MADV_DONTNEED, first, last - first)
