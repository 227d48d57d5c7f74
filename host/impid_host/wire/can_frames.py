"""CAN frames as bytes, for the recording: 24 bytes each, little-endian.

    u64 monotonic_ns | u32 identifier | u8 dlc | 3 zero bytes | 8 data bytes

The identifier carries its kind in the top bits as SocketCAN's `can_id` does: bit 31 extended, 30 remote, 29
error. The stamp is the host's monotonic clock when the frame was taken from the adapter.
"""

import numpy as np
from numpy.typing import NDArray

from impid_host.wire import native
from impid_host.wire.can import CanDecoder
from impid_host.wire.decoder import LinkCounts
from impid_host.wire.messages import COMMAND, WORD_BYTES
from impid_host.wire.records import Decoded
from impid_host.wire.tracker import Position

EXTENDED, REMOTE, ERROR = 1 << 31, 1 << 30, 1 << 29
CAN_FRAME = np.dtype(
    {
        "names": ["monotonic_ns", "identifier", "dlc", "data"],
        "formats": ["<u8", "<u4", "u1", "V8"],
        "offsets": [0, 8, 12, 16],
        "itemsize": 24,
    }
)


def pack_frame(monotonic_ns: int, identifier: int, data: bytes) -> bytes:
    """One frame; the identifier with its flag bits, at most 8 data bytes."""
    frame = np.zeros((), dtype=CAN_FRAME)
    frame["monotonic_ns"], frame["identifier"], frame["dlc"] = monotonic_ns, identifier, len(data)
    frame["data"] = np.void(data.ljust(WORD_BYTES, b"\0"))
    return frame.tobytes()


def unpack_frames(data: bytes) -> NDArray[np.void]:
    """Frames as a structured array of CAN_FRAME, shape (N,); a torn one at the end is left off."""
    whole = len(data) - len(data) % CAN_FRAME.itemsize
    return np.frombuffer(data[:whole], dtype=CAN_FRAME)


def encode_can_command(request_id: int, opcode: int, item: int = 0, value: int = 0) -> bytes:
    """A COMMAND as a packed frame without a stamp."""
    word = COMMAND.pack(request_id=request_id, opcode=opcode, item=item, value=value)
    return pack_frame(0, COMMAND.frame_id, word.astype("<u8").tobytes())


class CanBytesDecoder:
    """Decoder of packed frames; feed it pieces of whole frames, in order.

    In C where the extension is there and the stream goes on as it should, else in Python; both give the same.
    """

    def __init__(self, *, native: bool = native.available) -> None:
        self._decoder = CanDecoder()
        self._native = native

    @property
    def counts(self) -> LinkCounts:
        """Totals since the decoder was made."""
        return self._decoder.counts

    def resume(self, position: Position) -> None:
        """Begin in the middle of a stream, of which this sample comes next."""
        self._decoder.resume(position)

    def feed(self, data: bytes) -> Decoded:
        """What `data` completes. Frames that no board sends (extended, remote, short) are passed over."""
        frames = unpack_frames(data)
        followed = self._decoder.follow(frames) if self._native else None
        if followed is not None:
            return followed
        frames = frames[(frames["identifier"] < 1 << 11) & (frames["dlc"] == WORD_BYTES)]
        words = np.frombuffer(frames["data"].tobytes(), dtype="<u8")
        return self._decoder.feed(
            frames["identifier"].astype(np.uint16), words, frames["monotonic_ns"].astype(np.int64)
        )
