"""DMA controllers (RM0390 chapter 9): streams in direct mode between peripherals and memory.

A request moves one item at the instant it is made (dma.c). Arbitration delays of a few bus cycles are not
modelled, so stream priorities have no observable effect.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar

from hil_sim.board.elf.chip import CData, Registers, ffi, lib
from hil_sim.board.elf.registers import ALL, Peripheral, Register

if TYPE_CHECKING:
    from hil_sim.board.elf.soc import Soc

EN, TEIE, HTIE, TCIE, CT = 1, 1 << 2, 1 << 3, 1 << 4, 1 << 19
TCIF = 1 << 5
STREAMS = 8
FLAG_MASK = 0x0F7D_0F7D
# Request mapping (9.3.3): (controller, stream, channel) of sources whose request is a level; dma.c has all.
REQUESTS = {
    "USART2_RX": ("DMA1", 5, 4),
    "USART2_TX": ("DMA1", 6, 4),
}
STREAM_NAMES = ("CR", "NDTR", "PAR", "M0AR", "M1AR", "FCR")


class Stream:
    """One stream: its six registers and its progress."""

    def __init__(self, controller: "Dma", number: int, irq: int) -> None:
        self.controller = controller
        self.number = number
        self.shared: CData = controller.shared.streams[number]
        self.shared.irq = irq
        self.value = Registers(self.shared.reg, {name: place for place, name in enumerate(STREAM_NAMES)})
        self.value["FCR"] = 0x21

    @property
    def flags(self) -> int:
        """Event flags (9.5.1)."""
        return int(self.shared.flags)

    @property
    def enabled(self) -> bool:
        """EN."""
        return bool(self.value["CR"] & EN)

    @property
    def channel(self) -> int:
        """CHSEL."""
        return self.value["CR"] >> 25 & 7

    def write_cr(self, value: int) -> None:
        """Starts, stops or configures."""
        violation = self.controller.violation
        old = self.value["CR"]
        if old & EN:
            if (old ^ value) & ~(EN | TEIE | HTIE | TCIE | CT):
                raise violation(f"stream {self.number} configured while enabled", "9.5.5")
            self.value["CR"] = value
            if not value & EN:
                self.set_flags(TCIF)  # what was moved before the stop has arrived (9.3.14)
            self.update_line()
            return
        self.value["CR"] = value
        if value & EN:
            self._start()
        self.update_line()

    def _start(self) -> None:
        cr, violation = self.value["CR"], self.controller.violation
        if self.flags:
            raise violation(f"stream {self.number} enabled with event flags set", "9.3.17")
        if cr >> 6 & 3 == 2 or cr >> 6 & 3 == 3:
            raise self.controller.unmodelled("memory to memory", f"S{self.number}CR", 0, cr)
        if cr >> 11 & 3 != cr >> 13 & 3 or cr >> 11 & 3 == 3:
            raise violation("MSIZE differs from PSIZE in direct mode", "9.3.12")
        if self.value["NDTR"] == 0:
            raise violation(f"stream {self.number} enabled with nothing to transfer", "9.5.6")
        shared, (bank, offset) = self.shared, self.controller.soc.peripheral(self.value["PAR"])
        shared.total, shared.size, shared.offset = self.value["NDTR"], 1 << (cr >> 11 & 3), offset
        shared.peripheral = ffi.NULL if bank.shared is None else ffi.addressof(bank.shared, "bank")
        self.controller.started(self)

    def set_flags(self, flags: int) -> None:
        """Event flags, and the interrupt behind them."""
        lib.dma_set_flags(self.controller.shared, self.number, flags)

    def update_line(self) -> None:
        """The interrupt, after a change of its enables."""
        lib.dma_update_line(self.controller.shared, self.number)


class Dma(Peripheral):
    """A controller of eight streams."""

    REGISTERS: ClassVar[tuple[Register, ...]] = (
        Register("LISR", 0x00, "9.5.1"),
        Register("HISR", 0x04, "9.5.2"),
        Register("LIFCR", 0x08, "9.5.3", modelled=FLAG_MASK),
        Register("HIFCR", 0x0C, "9.5.4", modelled=FLAG_MASK),
    )
    STREAM_REGISTERS: ClassVar[tuple[Register, ...]] = (
        Register("CR", 0x00, "9.5.5", modelled=0x0E0F_7DDD),
        Register("NDTR", 0x04, "9.5.6", modelled=0xFFFF),
        Register("PAR", 0x08, "9.5.7", modelled=ALL),
        Register("M0AR", 0x0C, "9.5.8", modelled=ALL),
        Register("M1AR", 0x10, "9.5.9", modelled=ALL),
        Register("FCR", 0x14, "9.5.10", reset=0x21, modelled=0x3B),
    )

    def __init__(self, name: str, base: int, soc: "Soc", irqs: tuple[int, ...]) -> None:
        super().__init__(name, base, soc)
        self.streams = [Stream(self, number, irq) for number, irq in enumerate(irqs)]
        self._rows = {register.offset: register for register in self.STREAM_REGISTERS}
        self._waiting: dict[tuple[int, int], Callable[[], None]] = {}

    def _shared(self) -> CData:
        controller = ffi.new("dma *")
        lib.dma_bind(controller)
        return controller

    def _share(self) -> None:
        self._bind_bank()  # the registers of the streams are theirs

    def on_start(self, stream: int, channel: int, resume: Callable[[], None]) -> None:
        """A source whose request is a level: it looks again when its stream is enabled."""
        self._waiting[stream, channel] = resume

    def started(self, stream: Stream) -> None:
        """Lets a waiting request through, after the write that enabled the stream."""
        resume = self._waiting.get((stream.number, stream.channel))
        if resume is not None:
            self.soc.schedule.after(1, resume)

    def fail(self, stream: int) -> None:
        """The next transfer of a stream ends in a bus error (9.3.18)."""
        self.streams[stream].shared.failing = 1

    def read(self, offset: int, size: int) -> int:
        """Stream registers lie 0x18 apart from 0x10 on."""
        if not 0x10 <= offset < 0x10 + 0x18 * STREAMS or size != 4:
            return super().read(offset, size)
        number, inner = divmod(offset - 0x10, 0x18)
        stream, register = self.streams[number], self._rows[inner]
        # FS reads 100, empty (9.5.10): in direct mode nothing stays in the FIFO.
        return (
            stream.value[register.name] & ~0x38 | 0x20
            if register.name == "FCR"
            else stream.value[register.name]
        )

    def write(self, offset: int, size: int, value: int) -> None:
        """Registers other than CR are read-only while the stream is enabled."""
        if not 0x10 <= offset < 0x10 + 0x18 * STREAMS or size != 4:
            super().write(offset, size, value)
            return
        number, inner = divmod(offset - 0x10, 0x18)
        stream, register = self.streams[number], self._rows[inner]
        strange = (value ^ register.reset) & ~register.modelled & ALL
        if strange:
            raise self.unmodelled("write", f"S{number}{register.name}", offset, strange)
        if register.name == "CR":
            stream.write_cr(value)
        elif stream.enabled:
            raise self.violation(f"S{number}{register.name} written while the stream is enabled", "9.5.6")
        else:
            stream.value[register.name] = value
