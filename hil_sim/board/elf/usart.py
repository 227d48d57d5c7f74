"""Universal synchronous asynchronous receiver transmitter (RM0390 chapter 25): 8 data bits, 1 stop bit.

The line is two streams of bytes with the instants at which their last bits pass. A byte takes ten bit times
(start, eight, stop); a bit takes BRR cycles of the bus clock with 16 times oversampling (25.4.4).
"""

from collections import deque
from typing import TYPE_CHECKING, ClassVar

from hil_sim.board.elf.registers import ALL, Peripheral, Register
from hil_sim.board.elf.schedule import Event

if TYPE_CHECKING:
    from hil_sim.board.elf.soc import Soc

ORE, IDLE, RXNE, TC, TXE = 1 << 3, 1 << 4, 1 << 5, 1 << 6, 1 << 7
RE, TE, IDLEIE, RXNEIE, TCIE, TXEIE, UE = 1 << 2, 1 << 3, 1 << 4, 1 << 5, 1 << 6, 1 << 7, 1 << 13
EIE, DMAR, DMAT = 1 << 0, 1 << 6, 1 << 7
FRAME_BITS = 10
# The receiver samples the middle of the tenth bit: the other side may be this far off (25.4.5).
TOLERANCE = 0.0375


class Usart(Peripheral):
    """An asynchronous port; `signal_*` say whether its pins are switched to it."""

    REGISTERS: ClassVar[tuple[Register, ...]] = (
        Register("SR", 0x00, "25.6.1", reset=TXE | TC, modelled=ALL),
        Register("DR", 0x04, "25.6.2", modelled=0x1FF),
        Register("BRR", 0x08, "25.6.3", modelled=0xFFFF),
        Register("CR1", 0x0C, "25.6.4", modelled=RE | TE | IDLEIE | RXNEIE | TCIE | TXEIE | UE),
        Register("CR2", 0x10, "25.6.5"),
        Register("CR3", 0x14, "25.6.6", modelled=EIE | DMAR | DMAT),
    )
    WIDTHS = (1, 2, 4)

    def __init__(self, name: str, base: int, soc: "Soc", irq: int) -> None:
        super().__init__(name, base, soc)
        self.irq = irq
        self.sent = bytearray()
        self._holding: int | None = None  # DR, waiting for the shift register
        self._shifting = False
        self._received = 0
        self._status_read = False
        self._incoming: deque[int] = deque()
        self._line_rate = 0.0
        self._idle: Event | None = None
        self._arrival: Event | None = None
        for source, resume in ((f"{name}_TX", self._feed), (f"{name}_RX", self._offer)):
            soc.on_dma_start(source, resume)

    @property
    def bit_cycles(self) -> int:
        """Processor cycles a bit."""
        if self.value["BRR"] < 16:
            raise self.violation(f"BRR {self.value['BRR']} is below 16", "25.4.4")
        return self.value["BRR"] * self.soc.rcc.bus_divider(1)

    @property
    def baud(self) -> float:
        """Bits a second."""
        return self.soc.schedule.frequency / self.bit_cycles

    def _on(self, direction: int) -> bool:
        return self.value["CR1"] & (UE | direction) == UE | direction

    # --- transmitter (25.4.2) -----------------------------------------------------------------------

    def _load(self) -> None:
        """Moves DR into the shift register; TXE comes with it."""
        byte, self._holding = self._holding, None
        self.value["SR"] |= TXE
        if byte is None:
            raise self.violation("nothing to shift", "25.4.2")
        self._shifting = True
        self.soc.schedule.after(FRAME_BITS * self.bit_cycles, lambda: self._shifted(byte))

    def _shifted(self, byte: int) -> None:
        self.sent.append(byte)
        self._shifting = False
        if self._holding is not None:
            self._load()
            self._feed()
        else:
            self.value["SR"] |= TC
        self.update_line()

    def _feed(self) -> None:
        """TXE with DMAT requests the next byte; again after each until DR stays full."""
        while self.value["CR3"] & DMAT and self.value["SR"] & TXE and self._on(TE):
            if not self.soc.dma_request(f"{self.name}_TX"):
                return

    # --- receiver (25.4.3) --------------------------------------------------------------------------

    def receive(self, data: bytes, baud: float) -> None:
        """The other side sends bytes back to back, from now or after what it sends already."""
        self._incoming.extend(data)
        self._line_rate = baud
        if self._arrival is None and self._incoming:
            self._arrival = self.soc.schedule.after_seconds(FRAME_BITS / baud, self._arrives)

    def _arrives(self) -> None:
        self._arrival = None
        byte = self._incoming.popleft()
        if self._incoming:
            self._arrival = self.soc.schedule.after_seconds(FRAME_BITS / self._line_rate, self._arrives)
        if not self._on(RE) or not self.soc.routed(f"{self.name}_RX"):
            return
        if abs(self.baud / self._line_rate - 1) > TOLERANCE:
            raise self.violation(f"{self.baud:.0f} baud cannot receive {self._line_rate:.0f} baud", "25.4.5")
        if self.value["SR"] & RXNE:
            self.value["SR"] |= ORE  # the byte is lost, DR keeps the old one (25.4.3)
        else:
            self._received = byte
            self.value["SR"] |= RXNE
            self._offer()
        if self._idle is not None:
            self._idle.cancel()
        self._idle = self.soc.schedule.after(FRAME_BITS * self.bit_cycles, self._idles)
        self.update_line()

    def _offer(self) -> None:
        if self.value["CR3"] & DMAR and self.value["SR"] & RXNE:
            self.soc.dma_request(f"{self.name}_RX")

    def _idles(self) -> None:
        """A frame of idle line after a reception (25.4.3)."""
        self._idle = None
        self.value["SR"] |= IDLE
        self.update_line()

    # --- registers ----------------------------------------------------------------------------------

    def read_sr(self) -> int:
        """First half of the sequences that clear IDLE, ORE and TC."""
        self._status_read = True
        return self.value["SR"]

    def write_sr(self, value: int) -> None:
        """TC and RXNE are cleared by writing zeros; the others do not care."""
        self.value["SR"] &= value | ~(TC | RXNE)
        self.update_line()

    def read_dr(self) -> int:
        """Takes the received byte; after a read of SR also clears IDLE and ORE."""
        self.value["SR"] &= ~RXNE & ~((IDLE | ORE) if self._status_read else 0)
        self._status_read = False
        self.update_line()
        return self._received

    def write_dr(self, value: int) -> None:
        """Gives the next byte to send."""
        if not self._on(TE):
            raise self.violation("DR written while the transmitter is off", "25.4.2")
        if not self.soc.routed(f"{self.name}_TX"):
            raise self.violation("DR written while no pin is switched to TX", "7.3.2")
        if self._holding is not None:
            raise self.violation("DR overwritten before it was sent", "25.4.2")
        self._holding = value & 0xFF
        self.value["SR"] &= ~(TXE | (TC if self._status_read else 0))  # SR, then DR, clears TC (25.6.1)
        self._status_read = False
        if not self._shifting:
            self._load()
        self.update_line()

    def write_cr1(self, value: int) -> None:
        """Enables."""
        self.value["CR1"] = value
        self._feed_later()

    def write_cr3(self, value: int) -> None:
        """DMA enables."""
        self.value["CR3"] = value
        self._feed_later()

    def _feed_later(self) -> None:
        self.soc.schedule.after(1, self._feed)
        self.update_line()

    def update_line(self) -> None:
        """Each flag with its enable; ORE comes with RXNEIE, or with EIE under DMA (25.5)."""
        sr, cr1 = self.value["SR"], self.value["CR1"]
        high = (
            (sr & IDLE and cr1 & IDLEIE)
            or (sr & (RXNE | ORE) and cr1 & RXNEIE)
            or (sr & TC and cr1 & TCIE)
            or (sr & TXE and cr1 & TXEIE)
            or (sr & ORE and self.value["CR3"] & EIE and self.value["CR3"] & DMAR)
        )
        self.soc.nvic.set_line(self.irq, bool(high))
