"""Serial bytes to frames: split at the delimiter, undo COBS, check CRC, header and length.

A frame is accepted whole or not at all. After any damage the next delimiter starts afresh, so damage costs
the frames it touches and no other; what it cost is counted here in bytes and frames, and in samples by
the stream tracker, which sees the gap in the index.
"""

import zlib
from dataclasses import dataclass, field
from itertools import compress
from typing import Any

import numpy as np
from cobs import cobs
from numpy.typing import NDArray

from impid_host.wire import native
from impid_host.wire.frame import CRC_BYTES, DELIMITER, LARGEST_FRAME_BYTES
from impid_host.wire.messages import HEADER, PROTOCOL_VERSION, RECORD_BYTES
from impid_host.wire.native import Followed, Splitter

# CRC-32 over a message followed by its own CRC (little-endian) is this constant, whatever the message.
_CRC_RESIDUE = 0x2144DF1C
_HEADER_BYTES = HEADER.itemsize
_LEAST_BYTES = _HEADER_BYTES + CRC_BYTES
_SIZES = np.zeros((256, 2), np.int64)  # of a record of each kind, 0: none
for _kind, _sizes in RECORD_BYTES.items():
    _SIZES[_kind, : len(_sizes)] = _sizes


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


_NO_FRAMES = Frames(np.zeros(0, HEADER), np.zeros(0, np.uint8), np.zeros(0, np.int64))


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
    _splitter: Splitter = field(default_factory=Splitter)
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
        """Frames and samples at once, see `native.Splitter`; None: nothing was taken, `feed` it."""
        if not self.native or self._overlong:
            return None
        data = self._pending + data if self._pending else data
        followed = self._splitter.follow(data, boot_id, index, t_us, seq)
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
        if not pieces:
            return _NO_FRAMES, 0
        if self._overlong:
            self.counts.bad_frames -= not self._joined
            self._discard([pieces.pop(0)])
        elif not self._joined and pieces[0]:
            # Whoever listens in amid a frame gets its tail: discarded, but nothing was damaged.
            self.counts.bad_frames -= not _open(pieces[:1])[1][0]
        frames, good = _open(pieces)
        if not good.all():
            self._discard([piece for piece in compress(pieces, ~good) if piece])
        self._joined, self._overlong = True, False
        return frames, len(data) - len(pending)

    def _split_native(self, data: bytes) -> tuple[Frames, int]:
        headers, records, ends, found = self._splitter.deframe(
            data, joined=self._joined, overlong=self._overlong
        )
        self._joined, self._overlong = bool(found.joined), bool(found.overlong)
        self.counts.bad_frames += int(found.bad)
        self.counts.bytes_discarded += int(found.discarded)
        return Frames(headers, records, ends), int(found.pending_at)

    def _discard(self, pieces: list[bytes]) -> None:
        self.counts.bytes_discarded += sum(map(len, pieces))
        self.counts.bad_frames += len(pieces)


def _open(pieces: list[bytes]) -> tuple[Frames, NDArray[np.bool_]]:
    """The frames that are good, and which pieces (N,) they are."""
    raws = _unstuffed(pieces)
    count = len(pieces)
    sums = np.fromiter(map(zlib.crc32, raws), np.uint32, count)
    lengths = np.fromiter(map(len, raws), np.int64, count)
    good = (sums == _CRC_RESIDUE) & (lengths >= _LEAST_BYTES)
    if not good.all():
        raws, lengths = list(compress(raws, good)), lengths[good]
    frames = _apart(raws, lengths)
    told, bodies = frames.headers, np.diff(frames.ends, prepend=0)
    sizes = _SIZES[told["kind"]]
    fit = (sizes > 0) & (sizes * told["count"].astype(np.int64)[:, np.newaxis] == bodies[:, np.newaxis])
    right = fit.any(axis=1) & (told["version"] == PROTOCOL_VERSION)
    if not right.all():
        frames = _apart(list(compress(raws, right)), lengths[right])
        good[good] = right
    return frames, good


def _unstuffed(pieces: list[bytes]) -> list[bytes]:
    """Header, records and CRC of each; something that is no frame where COBS does not hold."""
    try:
        return list(map(cobs.decode, pieces))
    except cobs.DecodeError:
        return [_unstuffed_one(piece) for piece in pieces]


def _unstuffed_one(piece: bytes) -> bytes:
    try:
        raw: bytes = cobs.decode(piece)
    except cobs.DecodeError:
        return b""
    return raw


def _apart(raws: list[bytes], lengths: NDArray[np.int64]) -> Frames:
    """Headers and records of frames, all at once where they are of one length."""
    ends = np.cumsum(lengths - _LEAST_BYTES)
    data = np.frombuffer(b"".join(raws), np.uint8)
    if len(raws) and (lengths == lengths[0]).all():
        rows = data.reshape(len(raws), -1)
        headers = np.ascontiguousarray(rows[:, :_HEADER_BYTES]).view(HEADER)[:, 0]
        return Frames(headers, rows[:, _HEADER_BYTES:-CRC_BYTES].reshape(-1), ends)
    starts = np.cumsum(lengths) - lengths
    headers = data[starts[:, np.newaxis] + np.arange(_HEADER_BYTES)].reshape(-1).view(HEADER)
    records = b"".join([raw[_HEADER_BYTES:-CRC_BYTES] for raw in raws])
    return Frames(headers, np.frombuffer(records, np.uint8), ends)
