"""As much of the protobuf wire format as a recording needs: numbers, bytes, and the schema of a message.

Protobuf is what Foxglove and PlotJuggler plot and what stays small; its runtime is no dependency for four
kinds of fields. The tests read what is written here with Google's library."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Types of the fields as FileDescriptorProto numbers them.
UINT64, BYTES, UINT32, SINT32 = 4, 12, 13, 17
PACKAGE = "impid"
_LENGTH_DELIMITED, _VARINT = 2, 0
_OPTIONAL, _REPEATED = 1, 3
_SEVEN = np.uint64(0x7F)
_WORD = (1 << 64) - 1


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a message."""

    number: int
    type: int
    repeated: bool = False


def varint(value: int) -> bytes:
    """A number from 0 to 2**64 - 1."""
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def number(field: int, value: int) -> bytes:
    """A field of type uint32 or uint64 (modulo 2**64); a zero is left out, as proto3 does."""
    return varint(field << 3 | _VARINT) + varint(value & _WORD) if value else b""


def packed(field: int, content: bytes) -> bytes:
    """A field of type bytes, or a repeated one whose numbers `content` holds."""
    return varint(field << 3 | _LENGTH_DELIMITED) + varint(len(content)) + content if content else b""


def zigzag(values: NDArray[np.int64]) -> NDArray[np.uint64]:
    """What a varint of type sint32 holds, same shape."""
    folded: NDArray[np.uint64] = ((values << 1) ^ (values >> 63)).view(np.uint64)
    return folded


def varints(values: NDArray[np.uint64]) -> tuple[bytes, NDArray[np.int64]]:
    """Numbers (N,) as varints one after the other, and where each begins and the last ends, shape (N +
    1,)."""
    length = np.ones(len(values), np.int64)
    for bits in range(7, 64, 7):
        length += values >= np.uint64(1 << bits)
    starts = np.concatenate([[0], np.cumsum(length)])
    out = np.empty(int(starts[-1]), np.uint8)
    for n in range(int(length.max(initial=0))):
        has = length > n
        part = (values[has] >> np.uint64(7 * n)) & _SEVEN
        out[starts[:-1][has] + n] = part | ((length[has] > n + 1).astype(np.uint64) << np.uint64(7))
    return out.tobytes(), starts


def byte_fields(data: bytes) -> dict[int, bytes]:
    """The fields of a message all of whose fields are bytes.

    Raises:
        ValueError: it is no such message.
    """
    fields, at, end = {}, 0, len(data)
    while at < end:
        tag, at = _read_varint(data, at)
        length, at = _read_varint(data, at)
        if tag & 7 != _LENGTH_DELIMITED or at + length > end:
            raise ValueError("this is no message of bytes")
        fields[tag >> 3] = data[at : at + length]
        at += length
    return fields


def file_descriptor_set(message: str, fields: Mapping[str, Field]) -> bytes:
    """The schema of one message of the package, as MCAP wants it."""
    told = b"".join(packed(2, _field(name, field)) for name, field in fields.items())
    kind = packed(1, message.encode()) + told
    file = packed(1, f"{PACKAGE}/{message}.proto".encode()) + packed(2, PACKAGE.encode()) + packed(4, kind)
    return packed(1, file + packed(12, b"proto3"))


def numbered(names: Sequence[tuple[str, int]]) -> dict[str, Field]:
    """Fields that are no lists, numbered from 1 on."""
    return {name: Field(n, kind) for n, (name, kind) in enumerate(names, start=1)}


def _field(name: str, field: Field) -> bytes:
    label = _REPEATED if field.repeated else _OPTIONAL
    return packed(1, name.encode()) + number(3, field.number) + number(4, label) + number(5, field.type)


def _read_varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        if at >= len(data) or shift > 63:
            raise ValueError("a number does not end")
        byte = data[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            return value, at
