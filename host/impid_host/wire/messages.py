"""The message set as numpy sees it: every layout and every number is `impid.dbc`'s, by a table made from it.

The signals of a message are shifts and masks on its eight bytes taken as one little-endian 64-bit word, so
a million messages are unpacked by one numpy expression for each signal.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impid_host.wire.message_table import MESSAGES, NAMES

Words = NDArray[np.uint64]

WORD_BYTES = 8
PROTOCOL_VERSION = 1
SAMPLE_PERIOD_US = 1000
SERIAL_BAUD = 921600


def choices(message: str, signal: str) -> dict[str, int]:
    """Names of the values of a signal, as the message set lists them: name -> number."""
    return NAMES.get(f"{message}.{signal}", {})


@dataclass(frozen=True, slots=True)
class MessageLayout:
    """Where the signals of an 8-byte message lie in its 64-bit word.

    Attributes:
        name: the message.
        frame_id: its CAN identifier (11 bits).
        fields: signal -> (shift, mask), so that value = (word >> shift) & mask.
    """

    name: str
    frame_id: int
    fields: Mapping[str, tuple[int, int]]

    @classmethod
    def of(cls, name: str) -> "MessageLayout":
        """Layout of a message of eight bytes; ValueError if it is longer or shorter."""
        frame_id, size, signals = MESSAGES[name]
        if size != WORD_BYTES:
            raise ValueError(f"{name} is {size} bytes long; a word holds {WORD_BYTES}")
        fields = {signal: (start, (1 << bits) - 1) for signal, (start, bits) in signals.items()}
        return cls(name=name, frame_id=frame_id, fields=fields)

    def unpack(self, words: Words) -> dict[str, Words]:
        """Every signal of N messages: words of shape (N,) -> one uint64 array of shape (N,) per signal."""
        return {
            name: (words >> np.uint64(shift)) & np.uint64(mask) for name, (shift, mask) in self.fields.items()
        }

    def signal(self, name: str, words: Words) -> NDArray[np.unsignedinteger[Any]]:
        """One signal of N messages, words of shape (N,), in the smallest type that it lies in: (N,)."""
        shift, mask = self.fields[name]
        width = mask.bit_length()
        for bits in (8, 16, 32):
            at, off = divmod(shift, bits)
            if off + width <= bits:
                lane: NDArray[np.unsignedinteger[Any]] = words[:, np.newaxis].view(f"<u{bits // 8}")[:, at]
                if off:
                    lane = lane >> lane.dtype.type(off)
                return lane if off + width == bits else lane & lane.dtype.type(mask)
        return (words >> np.uint64(shift)) & np.uint64(mask)

    def pack(self, **values: ArrayLike) -> Words:
        """Words of shape (N,) from one array or number per signal; missing ones are 0, excess bits cut."""
        unknown = values.keys() - self.fields.keys()
        if unknown:
            raise ValueError(f"{self.name} has no signal {sorted(unknown)}")
        word = np.zeros(np.broadcast_shapes(*(np.shape(v) for v in values.values())), dtype=np.uint64)
        for name, value in values.items():
            shift, mask = self.fields[name]
            word = word | ((np.asarray(value).astype(np.uint64) & np.uint64(mask)) << np.uint64(shift))
        return np.atleast_1d(word)


# Where each field of the serial frame's header begins, bytes.
HEADER_OFFSET = {signal: start // 8 for signal, (start, _) in MESSAGES["BATCH"][2].items()}


def _header_dtype() -> np.dtype[Any]:
    _, size, signals = MESSAGES["BATCH"]
    for signal, (start, bits) in signals.items():
        if start % 8 or bits not in (8, 16, 32, 64):
            raise ValueError(f"BATCH.{signal} is not a whole integer on a byte boundary")
    return np.dtype(
        {
            "names": list(signals),
            "formats": [f"<u{bits // 8}" for _, bits in signals.values()],
            "offsets": list(HEADER_OFFSET.values()),
            "itemsize": size,
        }
    )


HEADER = _header_dtype()

COMMAND = MessageLayout.of("COMMAND")
RESPONSE = MessageLayout.of("RESPONSE")
PONG = MessageLayout.of("PONG")
ACCEL = MessageLayout.of("ACCEL")
ENCODER = MessageLayout.of("ENCODER")
ACCEL_FINE = MessageLayout.of("ACCEL_FINE")
TIME = MessageLayout.of("TIME")
EPOCH = MessageLayout.of("EPOCH")
# In the order of a record. On CAN STATUS_BUS closes the set, as before there were messages behind it.
STATUS = tuple(
    MessageLayout.of(name)
    for name in sorted(MESSAGES, key=lambda name: MESSAGES[name][0])
    if name.startswith("STATUS_")
)

OPCODE = choices("COMMAND", "opcode")
ITEM = choices("COMMAND", "item")
RESULT = choices("RESPONSE", "result")
RESULT_NAME = {number: name for name, number in RESULT.items()}
KIND = choices("BATCH", "kind")

# Sample flag on the wire: ACCEL_FINE belongs to this sample.
FLAG_FINE = 1 << 5
# The status messages of the first message set; a board of that time sends no others.
FIRST_STATUSES = 7
# Sizes of one record by kind, the present one first: a longer record has messages added at its end.
RECORD_BYTES = {
    KIND["SAMPLES"]: (2 * WORD_BYTES,),
    KIND["SAMPLES_WIDE"]: (3 * WORD_BYTES,),
    KIND["STATUS"]: (len(STATUS) * WORD_BYTES, FIRST_STATUSES * WORD_BYTES),
    KIND["RESPONSE"]: (WORD_BYTES,),
    KIND["PONG"]: (WORD_BYTES,),
    KIND["COMMAND"]: (WORD_BYTES,),
}
