"""General-purpose I/O ports (RM0390 chapter 7)."""

from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar

from hil_sim.board.elf.chip import CData, ffi, lib
from hil_sim.board.elf.registers import ALL, Peripheral, Register

if TYPE_CHECKING:
    from hil_sim.board.elf.soc import Soc

INPUT, OUTPUT, ALTERNATE, ANALOG = range(4)
# MODER, OSPEEDR and PUPDR after reset: port A and B carry the debug pins (7.4.1, 7.4.3, 7.4.4).
RESETS = {"A": (0xA800_0000, 0x0C00_0000, 0x6400_0000), "B": (0x0280, 0x00C0, 0x0100)}


class Gpio(Peripheral):
    """A port; `drive` sets what the world puts on a pin."""

    WIDTHS = (2, 4)
    REGISTERS: ClassVar[tuple[Register, ...]] = (
        Register("MODER", 0x00, "7.4.1", modelled=ALL),
        Register("OTYPER", 0x04, "7.4.2", modelled=0xFFFF),
        Register("OSPEEDR", 0x08, "7.4.3", modelled=ALL),
        Register("PUPDR", 0x0C, "7.4.4", modelled=ALL),
        Register("IDR", 0x10, "7.4.5"),
        Register("ODR", 0x14, "7.4.6", modelled=0xFFFF),
        Register("BSRR", 0x18, "7.4.7", modelled=ALL),
        Register("AFRL", 0x20, "7.4.9", modelled=ALL),
        Register("AFRH", 0x24, "7.4.10", modelled=ALL),
    )

    def __init__(self, letter: str, base: int, soc: "Soc") -> None:
        super().__init__(f"GPIO{letter}", base, soc)
        self._watcher: Callable[[], None] | None = None
        for name, value in zip(("MODER", "OSPEEDR", "PUPDR"), RESETS.get(letter, (0, 0, 0)), strict=True):
            self.value[name] = value

    def _shared(self) -> CData:
        gpio = ffi.new("gpio *")
        lib.gpio_bind(gpio)
        return gpio

    def mode(self, pin: int) -> int:
        """INPUT, OUTPUT, ALTERNATE or ANALOG."""
        return self.value["MODER"] >> 2 * pin & 3

    def alternate(self, pin: int) -> int | None:
        """The alternate function that the pin is switched to, if it is."""
        word = self.value["AFRL" if pin < 8 else "AFRH"]
        return word >> 4 * (pin % 8) & 15 if self.mode(pin) == ALTERNATE else None

    def drive(self, pin: int, high: bool | None) -> None:
        """What the world puts on a pin; None lets go of it."""
        shared, bit = self.shared, 1 << pin
        shared.driven = shared.driven & ~bit if high is None else shared.driven | bit
        shared.levels = shared.levels | bit if high else shared.levels & ~bit

    def level(self, pin: int) -> bool:
        """The pin: an output's own level, what drives it, or its pull resistor (open without one: low)."""
        return bool(lib.gpio_inputs(self.shared) >> pin & 1)

    def write(self, offset: int, size: int, value: int) -> None:
        """Some writes change what the pins are for."""
        super().write(offset, size, value)
        if self._watcher is not None:
            self._watcher()
        if offset < 0x04 or offset >= 0x20:  # MODER, AFRL, AFRH
            self.soc.pins_changed()

    def watch(self, watcher: Callable[[], None]) -> None:
        """Called after each write; the port is then slower."""
        self._watcher = watcher
        self.soc.take_from_c(self)

    def read_idr(self) -> int:
        """Levels of the sixteen pins."""
        return int(lib.gpio_inputs(self.shared))

    def read_bsrr(self) -> int:
        """Write-only: reads as 0."""
        return 0

    def write_bsrr(self, value: int) -> None:
        """Low half sets, high half resets; setting wins (7.4.7)."""
        self.value["ODR"] = (self.value["ODR"] & ~(value >> 16) | value) & 0xFFFF
