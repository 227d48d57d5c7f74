"""Universal synchronous asynchronous receiver transmitter (RM0390 chapter 25): 8 data bits, 1 stop bit.

The line is two streams of bytes with the instants at which their last bits pass. A byte takes ten bit times
(start, eight, stop); a bit takes BRR cycles of the bus clock with 16 times oversampling (25.4.4). The bytes
are usart.c's, what is configured is here.
"""

from typing import TYPE_CHECKING, ClassVar

from hil_sim.board.elf.chip import CData, ffi, lib
from hil_sim.board.elf.registers import ALL, Peripheral, Register

if TYPE_CHECKING:
    from hil_sim.board.elf.soc import Soc

RXNE, TC, TXE = 1 << 5, 1 << 6, 1 << 7
RE, TE, IDLEIE, RXNEIE, TCIE, TXEIE, UE = 1 << 2, 1 << 3, 1 << 4, 1 << 5, 1 << 6, 1 << 7, 1 << 13
EIE, DMAR, DMAT = 1 << 0, 1 << 6, 1 << 7


class Usart(Peripheral):
    """An asynchronous port."""

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
        shared = self.shared
        shared.irq, shared.holding = irq, -1
        shared.tx_signal, shared.rx_signal = soc.signal(f"{name}_TX"), soc.signal(f"{name}_RX")
        self._sent = bytearray()
        soc.on_dma_start(f"{name}_TX", lambda: lib.usart_feed(shared))
        soc.on_dma_start(f"{name}_RX", lambda: lib.usart_offer(shared))

    def _shared(self) -> CData:
        port = ffi.gc(ffi.new("usart *"), lib.usart_free)
        lib.usart_bind(port)
        return port

    @property
    def sent(self) -> bytearray:
        """What has left, to be cleared by whoever takes it."""
        shared = self.shared
        if shared.sent_count:
            self._sent += ffi.buffer(shared.sent, shared.sent_count)
            shared.sent_count = 0
        return self._sent

    @sent.setter
    def sent(self, sent: bytearray) -> None:
        self._sent = sent

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

    @property
    def damaged_bytes(self) -> int:
        """So many of the next ones arrive with noise and a bad stop bit."""
        return int(self.shared.damaged)

    @damaged_bytes.setter
    def damaged_bytes(self, count: int) -> None:
        self.shared.damaged = count

    def receive(self, data: bytes, baud: float) -> None:
        """The other side sends bytes back to back, from now or after what it sends already."""
        lib.usart_receive(self.shared, data, len(data), baud)

    # --- registers ----------------------------------------------------------------------------------

    def read_sr(self) -> int:
        """First half of the sequences that clear IDLE, the errors and TC."""
        return int(lib.usart_read_sr(self.shared))

    def read_dr(self) -> int:
        """Takes the received byte; after a read of SR also clears IDLE and the errors."""
        return int(lib.usart_read_dr(self.shared))

    def write_sr(self, value: int) -> None:
        """TC and RXNE are cleared by writing zeros; the others do not care."""
        self.value["SR"] &= value | ~(TC | RXNE)
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
        shared = self.shared
        self.soc.schedule.after(1, lambda: lib.usart_feed(shared))
        self.update_line()

    def update_line(self) -> None:
        """The interrupt, after a change of its enables."""
        lib.usart_update_line(self.shared)
