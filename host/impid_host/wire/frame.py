"""One serial frame: COBS(BATCH header | records | CRC-32) 00."""

import struct
import zlib
from dataclasses import dataclass

import numpy as np
from cobs import cobs

from impid_host.wire.messages import COMMAND, HEADER, KIND, PROTOCOL_VERSION, RECORD_BYTES

DELIMITER = b"\x00"
CRC_BYTES = 4
MAX_RECORDS = 255
# COBS adds one byte to every 254 and one at the head.
_LARGEST_RAW = HEADER.itemsize + MAX_RECORDS * max(map(max, RECORD_BYTES.values())) + CRC_BYTES
LARGEST_FRAME_BYTES = _LARGEST_RAW + _LARGEST_RAW // 254 + 1


@dataclass(frozen=True, slots=True)
class Header:
    """The BATCH header; t0_us is the instant of record 0 (samples) or of sending (other kinds)."""

    kind: int
    count: int
    boot_id: int = 0
    frame_seq: int = 0
    flags: int = 0
    first_index: int = 0
    t0_us: int = 0
    version: int = PROTOCOL_VERSION

    def to_bytes(self) -> bytes:
        """The 20 bytes of the header."""
        header = np.zeros((), dtype=HEADER)
        for name in HEADER.names or ():
            header[name] = getattr(self, name)
        return header.tobytes()


def encode_frame(header: Header, records: bytes) -> bytes:
    """The frame as it goes down the line, delimiter included.

    Raises:
        ValueError: the records are not `header.count` records of that kind.
    """
    if len(records) not in [header.count * size for size in RECORD_BYTES[header.kind]]:
        raise ValueError(f"{len(records)} bytes are not {header.count} records of kind {header.kind}")
    raw = header.to_bytes() + records
    stuffed: bytes = cobs.encode(raw + struct.pack("<I", zlib.crc32(raw)))
    return stuffed + DELIMITER


def encode_command(request_id: int, opcode: int, item: int = 0, value: int = 0) -> bytes:
    """A COMMAND frame, host to board."""
    record = (
        COMMAND.pack(request_id=request_id, opcode=opcode, item=item, value=value).astype("<u8").tobytes()
    )
    return encode_frame(Header(kind=KIND["COMMAND"], count=1), record)
