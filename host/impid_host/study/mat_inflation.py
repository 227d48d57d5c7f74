"""How large the compressed variables of a MATLAB 5 file become, found out without unpacking them.

A megabyte of zlib can hold a gigabyte of zeros, and the sizes that a header claims need not be true of the
fields of a structure. So each compressed element runs through zlib in small pieces, counted and dropped.
"""

import struct
import zlib
from pathlib import Path
from typing import BinaryIO

_HEADER_BYTES = 128
_COMPRESSED = 15
_PIECE = 1 << 16


def inflates_beyond(path: Path, limit: int) -> bool:
    """Whether the compressed variables of a MATLAB 5 to 7 file hold more than `limit` bytes together.

    Damaged elements count for what they yield up to the damage; reading them properly is left to the reader.
    """
    total = 0
    with path.open("rb") as file:
        header = file.read(_HEADER_BYTES)
        order = {b"IM": "<", b"MI": ">"}.get(header[126:128])
        while order is not None and len(tag := file.read(8)) == 8:
            kind, length = struct.unpack(order + "II", tag)
            following = file.tell() + length
            if kind == _COMPRESSED:
                total += _inflated_size(file, length, limit - total)
            if total > limit:
                return True
            file.seek(following)
    return False


def _inflated_size(file: BinaryIO, length: int, limit: int) -> int:
    """Bytes that the next `length` bytes of `file` inflate to; stops counting beyond `limit`."""
    inflater = zlib.decompressobj()
    size = 0
    pending = b""
    while size <= limit and not inflater.eof:
        if not pending:
            pending = file.read(min(_PIECE, length))
            length -= len(pending)
            if not pending:
                break
        try:
            size += len(inflater.decompress(pending, _PIECE))
        except zlib.error:
            break
        pending = inflater.unconsumed_tail
    return size
