"""DMA controllers (RM0390 chapter 9): streams in direct mode between peripherals and memory.

A request moves one item at the instant it is made. Arbitration delays of a few bus cycles are not modelled,
so stream priorities have no observable effect.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar

from hil_sim.board.elf.memory import MemoryRangeError
from hil_sim.board.elf.registers import ALL, Peripheral, Register

if TYPE_CHECKING:
    from hil_sim.board.elf.soc import Soc

EN, TEIE, HTIE, TCIE, CIRC, MINC, DBM, CT = 1, 1 << 2, 1 << 3, 1 << 4, 1 << 8, 1 << 10, 1 << 18, 1 << 19
TEIF, HTIF, TCIF = 1 << 3, 1 << 4, 1 << 5
STREAMS = 8
NOWHERE = 0x6000_0000  # an address without memory
FLAG_SHIFT = (0, 6, 16, 22)  # of streams 0 to 3 in LISR, and of 4 to 7 in HISR (9.5.1)
FLAG_MASK = 0x0F7D_0F7D
# Request mapping (9.3.3, tables of DMA1 and DMA2): (controller, stream, channel) of each source used.
REQUESTS = {
    "TIM2_CH3": ("DMA1", 1, 3),
    "TIM5_CH3": ("DMA1", 0, 6),
    "USART2_RX": ("DMA1", 5, 4),
    "USART2_TX": ("DMA1", 6, 4),
    "ADC1": ("DMA2", 0, 0),
}


class Stream:
    """One stream: its six registers and its progress."""

    def __init__(self, controller: "Dma", number: int, irq: int) -> None:
        self.controller = controller
        self.number = number
        self.irq = irq
        self.value = {"CR": 0, "NDTR": 0, "PAR": 0, "M0AR": 0, "M1AR": 0, "FCR": 0x21}
        self.flags = 0
        self._total = 0
        self._size = 1
        self._offset = 0
        self.failing = False
        self._bank: Peripheral = controller
        self.block_ended = False  # the last item moved was the last of NDTR

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
        self._total = self.value["NDTR"]
        self._size = 1 << (cr >> 11 & 3)
        self._bank, self._offset = self.controller.soc.peripheral(self.value["PAR"])
        self.controller.started(self)

    def transfer(self) -> None:
        """Moves one item."""
        cr, size = self.value["CR"], self._size
        memory = NOWHERE if self.failing else self.value["M1AR" if cr & DBM and cr & CT else "M0AR"]
        if cr & MINC:
            memory += (self._total - self.value["NDTR"]) * size
        ram = self.controller.soc.memory
        try:
            if cr >> 6 & 1:
                self._bank.write(self._offset, size, int.from_bytes(ram.read_bytes(memory, size), "little"))
            else:
                ram.write_ram(memory, self._bank.read(self._offset, size).to_bytes(size, "little"))
        except MemoryRangeError:
            self.value["CR"] &= ~EN  # a bus error stops the stream (9.3.18)
            self.set_flags(TEIF)
            return
        self._advance()

    def _advance(self) -> None:
        left = self.value["NDTR"] - 1
        self.value["NDTR"] = left
        self.block_ended = left == 0
        if left == self._total // 2:
            self.set_flags(HTIF)
        if left == 0:
            self._complete()

    def _complete(self) -> None:
        cr = self.value["CR"]
        if cr & DBM:
            self.value["CR"] ^= CT  # double-buffer mode is circular (9.3.10)
        if cr & (CIRC | DBM):
            self.value["NDTR"] = self._total
        else:
            self.value["CR"] &= ~EN
        self.set_flags(TCIF)

    def set_flags(self, flags: int) -> None:
        """Event flags, and the interrupt behind them."""
        self.flags |= flags
        self.update_line()

    def update_line(self) -> None:
        """TEIE, HTIE and TCIE are one bit below their flags."""
        enables = self.value["CR"]
        wanted = (
            (TEIF if enables & TEIE else 0)
            | (HTIF if enables & HTIE else 0)
            | (TCIF if enables & TCIE else 0)
        )
        self.controller.soc.nvic.set_line(self.irq, bool(self.flags & wanted))


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

    def on_start(self, stream: int, channel: int, resume: Callable[[], None]) -> None:
        """A source whose request is a level: it looks again when its stream is enabled."""
        self._waiting[stream, channel] = resume

    def started(self, stream: Stream) -> None:
        """Lets a waiting request through, after the write that enabled the stream."""
        resume = self._waiting.get((stream.number, stream.channel))
        if resume is not None:
            self.soc.schedule.after(1, resume)

    def request(self, stream: int, channel: int) -> bool:
        """Moves one item if the stream is enabled and listens to the channel. Returns whether it was."""
        chosen = self.streams[stream]
        if not chosen.enabled or chosen.channel != channel:
            return False
        chosen.transfer()
        return True

    def fail(self, stream: int) -> None:
        """The next transfer of a stream ends in a bus error (9.3.18)."""
        self.streams[stream].failing = True

    def _flags(self, first: int) -> int:
        return sum(self.streams[first + index].flags << shift for index, shift in enumerate(FLAG_SHIFT))

    def read_lisr(self) -> int:
        """Flags of streams 0 to 3."""
        return self._flags(0)

    def read_hisr(self) -> int:
        """Flags of streams 4 to 7."""
        return self._flags(4)

    def _clear(self, first: int, value: int) -> None:
        for index, shift in enumerate(FLAG_SHIFT):
            stream = self.streams[first + index]
            stream.flags &= ~(value >> shift & 0x3D)
            stream.update_line()

    def write_lifcr(self, value: int) -> None:
        """Ones clear flags of streams 0 to 3."""
        self._clear(0, value)

    def write_hifcr(self, value: int) -> None:
        """Ones clear flags of streams 4 to 7."""
        self._clear(4, value)

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
