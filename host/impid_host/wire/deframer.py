"""Serial bytes to frames: split at the delimiter, undo COBS, check CRC, header and length.

A frame is accepted whole or not at all. After any damage the next delimiter starts afresh, so damage costs
the frames it touches and no other; what it cost is counted here in bytes and frames, and in samples by
the stream tracker, which sees the gap in the index.
"""

import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from cobs import cobs
from numpy.typing import NDArray

from impid_host.wire import native
from impid_host.wire.frame import CRC_BYTES, DELIMITER, LARGEST_FRAME_BYTES
from impid_host.wire.messages import HEADER, HEADER_OFFSET, PROTOCOL_VERSION, RECORD_BYTES
from impid_host.wire.native import Followed

# CRC-32 over a message followed by its own CRC (little-endian) is this constant, whatever the message.
_CRC_RESIDUE = 0x2144DF1C
_HEADER_BYTES = HEADER.itemsize
_KIND_AT, _VERSION_AT, _COUNT_AT = (HEADER_OFFSET[name] for name in ("kind", "version", "count"))


@dataclass(frozen=True, slots=True)
class Frames:
    """Good frames in order of arrival.

    Attributes:
        headers: structured array of the BATCH fields, shape (N,).
        records: the records of all frames one after the other, without headers and CRC, shape (bytes,).
        ends: where those of each frame end, shape (N,).
    """

    headers: NDArray[Any]
    records: NDArray[np.uint8]
    ends: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.headers)

    def of(self, which: int) -> NDArray[np.uint8]:
        """The records of one frame."""
        return self.records[int(self.ends[which - 1]) if which else 0 : int(self.ends[which])]


@dataclass(slots=True)
class FrameCounts:
    """What the line delivered: whole frames, damaged ones, and the bytes that belonged to no good frame."""

    good_frames: int = 0
    bad_frames: int = 0
    bytes_discarded: int = 0


@dataclass(slots=True)
class Deframer:
    """Feed it whatever the port gives, in pieces of any size. In C where the extension is there, else in
    Python; both give the same."""

    counts: FrameCounts = field(default_factory=FrameCounts)
    native: bool = native.available
    _pending: bytes = b""
    _overlong: bool = False  # within a run without a delimiter that is too long for any frame
    _joined: bool = False  # a delimiter was seen: what follows starts at a frame's first byte

    def feed(self, data: bytes) -> Frames:
        """The frames that `data` completes."""
        data = self._pending + data if self._pending else data
        split = self._split_native if self.native else self._split
        frames, pending_at = split(data)
        self._keep(data[pending_at:], len(frames))
        return frames

    def follow(self, data: bytes, boot_id: int, index: int, t_us: int, seq: int) -> Followed | None:
        """Frames and samples at once, see `native.follow`; None: nothing was taken, `feed` it."""
        if not self.native or self._overlong:
            return None
        data = self._pending + data if self._pending else data
        followed = native.follow(data, boot_id, index, t_us, seq)
        if followed is not None:
            self._keep(data[followed.pending_at :], followed.frames)
        return followed

    def _keep(self, rest: bytes, good_frames: int) -> None:
        self._pending = rest
        if len(rest) > LARGEST_FRAME_BYTES:
            self.counts.bytes_discarded += len(rest)
            self._pending, self._overlong = b"", True
        self.counts.good_frames += good_frames

    def _split(self, data: bytes) -> tuple[Frames, int]:
        """The frames, and where what is no whole one begins."""
        pieces = data.split(DELIMITER)
        pending = pieces.pop()
        raws = []
        for piece in pieces:
            raw = _open(piece) if piece and not self._overlong else None
            if raw is not None:
                raws.append(raw)
            elif piece or self._overlong:
                self._discard(piece)
            self._joined, self._overlong = True, False
        headers = np.frombuffer(b"".join([raw[:_HEADER_BYTES] for raw in raws]), dtype=HEADER)
        records = [raw[_HEADER_BYTES:-CRC_BYTES] for raw in raws]
        ends = np.cumsum([len(record) for record in records], dtype=np.int64)
        frames = Frames(headers, np.frombuffer(b"".join(records), np.uint8), ends)
        return frames, len(data) - len(pending)

    def _split_native(self, data: bytes) -> tuple[Frames, int]:
        headers, records, ends, found = native.deframe(data, joined=self._joined, overlong=self._overlong)
        self._joined, self._overlong = bool(found.joined), bool(found.overlong)
        self.counts.bad_frames += int(found.bad)
        self.counts.bytes_discarded += int(found.discarded)
        return Frames(headers, records, ends), int(found.pending_at)

    def _discard(self, piece: bytes) -> None:
        self.counts.bytes_discarded += len(piece)
        # Whoever listens in mid-frame gets the tail of one first: discarded, but nothing was damaged.
        self.counts.bad_frames += self._joined


def _open(piece: bytes) -> bytes | None:
    """Header, records and CRC of one frame; None if anything about it is wrong."""
    try:
        raw: bytes = cobs.decode(piece)
    except cobs.DecodeError:
        return None
    if len(raw) < _HEADER_BYTES + CRC_BYTES or zlib.crc32(raw) != _CRC_RESIDUE:
        return None
    if raw[_VERSION_AT] != PROTOCOL_VERSION:
        return None
    records_bytes = len(raw) - _HEADER_BYTES - CRC_BYTES
    count = raw[_COUNT_AT]
    for size in RECORD_BYTES.get(raw[_KIND_AT], ()):
        if records_bytes == count * size:
            return raw
    return None
