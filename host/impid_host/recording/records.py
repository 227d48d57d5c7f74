"""The records of an MCAP file in order, whatever has happened to the file.

Damage costs the records that it touches: behind it the reading goes on at the next record that is
whole, which is a chunk whose checksum holds. A cut-off file ends with what could not be read any more.
"""

import struct
from collections.abc import Iterator
from io import BytesIO
from mmap import ACCESS_READ, mmap
from pathlib import Path

import zstandard
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Chunk, DataEnd, Footer, Header, McapRecord
from mcap.stream_reader import StreamReader, breakup_chunk

from impid_host.errors import InputError
from impid_host.recording import channels

_MAGIC = b"\x89MCAP0\r\n"
_HEAD_BYTES = 9  # opcode and length
# A chunk holds 100 ms, a few kB; anything far larger is damage and must not fill the memory.
_LARGEST_RECORD_BYTES = 64 << 20
# The library reads what the damaged bytes ask for, so it may fail in any of these ways.
_DAMAGE = (McapError, struct.error, ValueError, OverflowError, MemoryError, zstandard.ZstdError)
_CHUNK = bytes([Opcode.CHUNK])
_NOT_OURS = "give a file that `impid-host record` has written"


def read_records(path: Path, warnings: list[str]) -> Iterator[McapRecord]:
    """Records in order, chunks opened; what is damaged or missing is skipped and added to the warnings.

    Raises:
        InputError: no such file, or not a recording of impid.
    """
    try:
        with path.open("rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as data:
            yield from _records(path, data, warnings)
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check the name") from None
    except ValueError:  # an empty file cannot be mapped
        raise InputError(path, "is not an MCAP file", _NOT_OURS) from None


def _records(path: Path, data: mmap, warnings: list[str]) -> Iterator[McapRecord]:
    first = _record_at(data, len(_MAGIC)) if data[: len(_MAGIC)] == _MAGIC else None
    if first is None:
        raise InputError(path, "is not an MCAP file", _NOT_OURS)
    header, at = first
    if not isinstance(header, Header) or header.profile != channels.PROFILE:
        raise InputError(path, "is an MCAP file, but not a recording of impid", _NOT_OURS)
    while at < len(data):
        found = _record_at(data, at)
        if found is None:
            resumed = _next_chunk(data, at + 1)
            if resumed is None:
                break
            warnings.append(f"{path}: bytes {at} to {resumed - 1} are damaged and are skipped")
            at = resumed
            continue
        record, at = found
        if isinstance(record, Chunk):
            try:
                yield from breakup_chunk(record, validate_crc=True)
            except _DAMAGE:
                warnings.append(f"{path}: a chunk before byte {at} is damaged and is skipped")
        elif isinstance(record, (DataEnd, Footer)):
            return  # an index follows, for readers that want one
        else:
            yield record
    warnings.append(
        f"{path}: was cut off (power cut, crash or full disk): up to 0.1 s before its end "
        f"is missing, and {len(data) - at} of its {len(data)} bytes are an incomplete record"
    )


def _record_at(data: mmap, at: int) -> tuple[McapRecord, int] | None:
    """The record that begins there, chunks unopened, and where the next begins; None if it makes no sense."""
    if at + _HEAD_BYTES > len(data):
        return None
    opcode, length = data[at], struct.unpack_from("<Q", data, at + 1)[0]
    end = at + _HEAD_BYTES + length
    if not Opcode.HEADER <= opcode <= Opcode.DATA_END or length > _LARGEST_RECORD_BYTES or end > len(data):
        return None
    try:
        reader = StreamReader(BytesIO(data[at:end]), skip_magic=True, emit_chunks=True)
        record = DataEnd(0) if opcode == Opcode.DATA_END else next(reader.records)
    except (*_DAMAGE, StopIteration):
        return None
    if isinstance(record, Chunk) and _swells(record):
        return None
    return record, end


def _swells(chunk: Chunk) -> bool:
    """Whether opening it would fill the memory: the library believes the size that stands inside."""
    sizes = [chunk.uncompressed_size]
    if chunk.compression == "zstd":
        try:
            sizes.append(zstandard.frame_content_size(chunk.data))
        except zstandard.ZstdError:
            return True
    return max(sizes) > _LARGEST_RECORD_BYTES


def _next_chunk(data: mmap, at: int) -> int | None:
    """Where the next chunk whose checksum holds begins."""
    while (at := data.find(_CHUNK, at)) >= 0:
        found = _record_at(data, at)
        if found is not None and isinstance(found[0], Chunk):
            try:
                if breakup_chunk(found[0], validate_crc=True):
                    return at
            except _DAMAGE:
                pass
        at += 1
    return None
