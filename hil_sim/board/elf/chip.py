"""The C part of the chip (chip.h): registers shared with it, and what it asks of Python.

A model whose registers are shared has them in a C struct; `Registers` shows them by name.
"""

from collections.abc import Iterator, MutableMapping, MutableSet
from typing import TYPE_CHECKING, Any

from hil_sim._chip import ffi, lib

if TYPE_CHECKING:
    from hil_sim.board.elf.soc import Soc

CData = Any  # what cffi hands out

__all__ = ["BitSet", "CData", "Registers", "ffi", "lib"]


class Registers(MutableMapping[str, int]):
    """Words of a C array by the names of registers; none can be added or taken away."""

    def __init__(self, words: CData, places: dict[str, int]) -> None:
        self._words = words
        self._places = places

    def __getitem__(self, name: str) -> int:
        return int(self._words[self._places[name]])

    def __setitem__(self, name: str, value: int) -> None:
        self._words[self._places[name]] = value & 0xFFFF_FFFF

    def __delitem__(self, name: str) -> None:
        raise TypeError(f"register {name} cannot be deleted")

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)


class BitSet(MutableSet[int]):
    """Numbers that are the ones in an array of 32-bit words."""

    def __init__(self, words: CData) -> None:
        self._words = words

    def __contains__(self, number: object) -> bool:
        return isinstance(number, int) and bool(self._words[number // 32] >> number % 32 & 1)

    def __iter__(self) -> Iterator[int]:
        for place, word in enumerate(self._words):
            yield from (32 * place + bit for bit in range(32) if word >> bit & 1)

    def __len__(self) -> int:
        return sum(int(word).bit_count() for word in self._words)

    def add(self, value: int) -> None:
        """Sets a bit."""
        self._words[value // 32] |= 1 << value % 32

    def discard(self, value: int) -> None:
        """Clears a bit."""
        self._words[value // 32] &= ~(1 << value % 32) & 0xFFFF_FFFF


def _soc(chip: CData) -> "Soc":
    soc: Soc = ffi.from_handle(chip.handle)
    return soc


# What chip.h declares as Python's. An error is kept by the chip and raised once the C code has returned.


@ffi.def_extern()  # type: ignore[untyped-decorator]
def chip_read(chip: CData, address: int, size: int) -> int:
    """A read that no C model answers."""
    soc = _soc(chip)
    with soc.cpu.keeping():
        return soc.bus_read(address, size)
    return 0


@ffi.def_extern()  # type: ignore[untyped-decorator]
def chip_write(chip: CData, address: int, size: int, value: int) -> None:
    """A write that no C model takes."""
    soc = _soc(chip)
    with soc.cpu.keeping():
        soc.bus_write(address, size, value)


@ffi.def_extern()  # type: ignore[untyped-decorator]
def chip_routed(chip: CData, signal: int) -> int:
    """A pin is switched to a signal."""
    return int(_soc(chip).find_route(signal))


@ffi.def_extern()  # type: ignore[untyped-decorator]
def chip_source(chip: CData, channel: int) -> int:
    """What an analogue channel reads."""
    soc = _soc(chip)
    with soc.cpu.keeping():
        return soc.adc.source(channel)
    return 0


@ffi.def_extern()  # type: ignore[untyped-decorator]
def chip_position(chip: CData, number: int) -> int:
    """Where the encoder of a timer is."""
    soc = _soc(chip)
    with soc.cpu.keeping():
        position = soc.timer_list[number].position
        return position() if position is not None else 0
    return 0


@ffi.def_extern()  # type: ignore[untyped-decorator]
def chip_event(chip: CData, number: int) -> None:
    """An event that Python asked for happens."""
    soc = _soc(chip)
    with soc.cpu.keeping():
        soc.schedule.happens(number)


@ffi.def_extern()  # type: ignore[untyped-decorator]
def chip_exception(chip: CData, exception: int, entering: int) -> None:
    """An exception is entered or left."""
    soc = _soc(chip)
    with soc.cpu.keeping():
        if soc.on_exception is not None:
            soc.on_exception(exception, bool(entering))


@ffi.def_extern()  # type: ignore[untyped-decorator]
def chip_settle(chip: CData) -> None:
    """The processor stands still after it has touched the flash."""
    soc = _soc(chip)
    with soc.cpu.keeping():
        soc.settle()


@ffi.def_extern()  # type: ignore[untyped-decorator]
def chip_bite(chip: CData) -> None:
    """The watchdog's time is up."""
    _soc(chip).request_reset("iwdg")
