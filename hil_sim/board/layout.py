"""The message set as numpy reads it: where each signal lies in its message, from the DBC file alone."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cantools
import numpy as np
from cantools.database.can import Database
from numpy.typing import NDArray

DBC = Path(__file__).with_name("impid.dbc")


@cache
def database() -> Database:
    """The message set."""
    loaded = cantools.database.load_file(DBC)
    assert isinstance(loaded, Database)
    return loaded


@cache
def code(message: str, signal: str, name: str) -> int:
    """The number behind a named value, for example code("BATCH", "kind", "SAMPLES")."""
    choices = database().get_message_by_name(message).get_signal_by_name(signal).choices
    for number, choice in (choices or {}).items():
        if str(choice) == name:
            return int(number)
    raise KeyError(f"{message}.{signal} has no value {name}")


@dataclass(frozen=True)
class _Field:
    start: int
    length: int


@cache
def _fields(message: str) -> dict[str, _Field]:
    signals = database().get_message_by_name(message).signals
    return {signal.name: _Field(signal.start, signal.length) for signal in signals}


def unpack(message: str, payloads: NDArray[np.uint8]) -> dict[str, NDArray[np.uint64]]:
    """Raw unsigned values of every signal.

    Args:
        message: name in the DBC file; little-endian signals.
        payloads: shape (n, 8), the bytes of n messages.

    Returns:
        One array of shape (n,) per signal.
    """
    words = np.ascontiguousarray(payloads).view("<u8")[:, 0]
    return {
        name: (words >> np.uint64(field.start)) & np.uint64((1 << field.length) - 1)
        for name, field in _fields(message).items()
    }
