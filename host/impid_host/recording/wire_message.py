"""The message of `/wire` and `/can`: what passed in at most 100 ms, both ways, and where the stream stood.

Every field is bytes, all numbers are little-endian:

    rx_calls   of each read: i64 monotonic_ns, i64 wall_ns - monotonic_ns, u32 bytes
    rx_rows    u32 each: how the bytes are cut, see `transposed`
    rx_bytes   the bytes, in that order
    tx_...     the same of what was written
    exchanges  of each: i64 t1_ns, t2_us, t3_us, t4_ns, u32 boot_id
    position   of the sample expected next, before this message: u16 boot_id, u16 run, u32 zero, u64
               index, u64 t_us
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impid_host.clock.device import ClockExchange
from impid_host.link.link import Chunk
from impid_host.recording.channels import WIRE_FIELDS
from impid_host.recording.protobuf import byte_fields, packed
from impid_host.recording.transposed import restore, transpose
from impid_host.wire.tracker import Position

CALL = np.dtype([("monotonic_ns", "<i8"), ("wall_minus_ns", "<i8"), ("bytes", "<u4")])
_EXCHANGE = struct.Struct("<qqqqI")
_POSITION = struct.Struct("<HH4xQQ")
_NUMBER = {name: field.number for name, field in WIRE_FIELDS.items()}


@dataclass(frozen=True, slots=True)
class WireMessage:
    """A message read back; nothing of it is unpacked before it is asked for, and what then makes no sense
    is a ValueError."""

    carrier: str
    fields: dict[int, bytes]

    @property
    def rx(self) -> NDArray[np.uint8]:
        """The bytes that came in."""
        return restore(self._of("rx_rows"), self._of("rx_bytes"), self.carrier)

    @property
    def rx_calls(self) -> NDArray[Any]:
        """Each read, shape (N,) of CALL."""
        return np.frombuffer(self._of("rx_calls"), CALL)

    @property
    def exchanges(self) -> list[tuple[int, ...]]:
        """t1_ns, t2_us, t3_us, t4_ns and boot_id of each clock exchange."""
        stored = self._of("exchanges")
        if len(stored) % _EXCHANGE.size:
            raise ValueError("torn clock exchanges")
        return list(_EXCHANGE.iter_unpack(stored))

    @property
    def position(self) -> Position | None:
        """The sample expected next, before this message; None before the first."""
        stored = self._of("position")
        if len(stored) not in (0, _POSITION.size):
            raise ValueError("a torn position")
        return Position(*_POSITION.unpack(stored)) if stored else None

    def _of(self, name: str) -> bytes:
        return self.fields.get(_NUMBER[name], b"")


def pack(
    carrier: str,
    received: Sequence[Chunk],
    sent: Sequence[Chunk],
    exchanges: Sequence[tuple[ClockExchange, int]],
    position: Position | None,
) -> bytes:
    """A message of what passed, in order."""
    fields: dict[str, bytes] = {}
    for name, chunks in (("rx", received), ("tx", sent)):
        data = b"".join(chunk.data for chunk in chunks)
        calls = np.array(
            [(c.monotonic_ns, c.wall_ns - c.monotonic_ns, len(c.data)) for c in chunks], dtype=CALL
        )
        rows, ordered = transpose(data, carrier) if data else (b"", b"")
        fields |= {f"{name}_calls": calls.tobytes(), f"{name}_rows": rows, f"{name}_bytes": ordered}
    fields["exchanges"] = b"".join(
        _EXCHANGE.pack(e.t1_ns, e.t2_us, e.t3_us, e.t4_ns, boot_id) for e, boot_id in exchanges
    )
    if position is not None:
        fields["position"] = _POSITION.pack(position.boot_id, position.run, position.index, position.t_us)
    return b"".join(packed(_NUMBER[name], content) for name, content in fields.items())


def unpack(data: bytes, carrier: str) -> WireMessage:
    """A message read back.

    Raises:
        ValueError: it makes no sense.
    """
    return WireMessage(carrier, byte_fields(data))
