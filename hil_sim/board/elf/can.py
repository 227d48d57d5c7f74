"""Controller area network bxCAN (RM0390 chapter 30): modes and configuration; the bus itself is in can.c.

Frames pass whole. A frame takes as long as the most stuff bits allow; whether it is acknowledged, or damaged
so that error counters move as ISO 11898-1 says, is decided by the bus that a test sets up.
"""

from typing import TYPE_CHECKING, ClassVar

from hil_sim.board.elf.can_frame import Frame
from hil_sim.board.elf.chip import CData, ffi, lib
from hil_sim.board.elf.registers import ALL, Peripheral, Register

if TYPE_CHECKING:
    from hil_sim.board.elf.soc import Soc

INRQ, SLEEP, TXFP, RFLM, NART, ABOM, DBF = 1 << 0, 1 << 1, 1 << 2, 1 << 3, 1 << 4, 1 << 6, 1 << 16
INAK, SLAK, ERRI = 1 << 0, 1 << 1, 1 << 2
INTERRUPTS = 0x0000_8F1F  # TMEIE, FMPIE0, FFIE0, FOVIE0, FMPIE1, EWGIE, EPVIE, BOFIE, LECIE, ERRIE
FILTERS = 28
RECOVERY_BITS = int(lib.CAN_RECOVERY_BITS)


class Can(Peripheral):
    """bxCAN as the master CAN1 with its 28 filter banks (all of them its own: CAN2SB stays at reset)."""

    REGISTERS: ClassVar[tuple[Register, ...]] = (
        Register("MCR", 0x00, "30.9.2", 0x0001_0002, INRQ | SLEEP | TXFP | RFLM | NART | ABOM | DBF),
        Register("MSR", 0x04, "30.9.2", 0x0000_0C02, 0x1C | 0xFFF),
        Register("TSR", 0x08, "30.9.2", 0x1C00_0000, ALL),
        Register("RF0R", 0x0C, "30.9.2", 0, 0x3F),
        Register("RF1R", 0x10, "30.9.2", 0, 0x3F),
        Register("IER", 0x14, "30.9.2", 0, INTERRUPTS),
        Register("ESR", 0x18, "30.9.2", 0, 0x70),
        Register("BTR", 0x1C, "30.9.2", 0x0123_0000, 0xC37F_03FF),
        Register("FMR", 0x200, "30.9.4", 0x2A1C_0E01, 0x3F01),
        Register("FM1R", 0x204, "30.9.4", 0, (1 << FILTERS) - 1),
        Register("FS1R", 0x20C, "30.9.4", 0, (1 << FILTERS) - 1),
        Register("FFA1R", 0x214, "30.9.4", 0, (1 << FILTERS) - 1),
        Register("FA1R", 0x21C, "30.9.4", 0, (1 << FILTERS) - 1),
    )  # fmt: skip

    def __init__(self, name: str, base: int, soc: "Soc") -> None:
        super().__init__(name, base, soc)
        shared = self.shared
        shared.tx_signal, shared.rx_signal = soc.signal(f"{name}_TX"), soc.signal(f"{name}_RX")
        shared.sending, shared.acknowledged = -1, 1
        self._sent: list[Frame] = []

    def _shared(self) -> CData:
        controller = ffi.gc(ffi.new("can *"), lib.can_free)
        lib.can_bind(controller)
        return controller

    # --- the bus, as a test sees it and sets it up ----------------------------------------------------

    @property
    def sent(self) -> list[Frame]:
        """Frames that have left, to be cleared by whoever takes them."""
        queue = self.shared.sent
        self._sent += [_frame(queue.frames[queue.first + n]) for n in range(queue.count)]
        queue.first = queue.count = 0
        return self._sent

    @sent.setter
    def sent(self, sent: list[Frame]) -> None:
        self._sent = sent

    @property
    def fifos(self) -> list[list[Frame]]:
        """Frames that wait in the two receive FIFOs."""
        shared = self.shared
        return [[_frame(shared.fifos[n][k]) for k in range(shared.fifo_count[n])] for n in range(2)]

    @property
    def acknowledged(self) -> bool:
        """Another node takes part in the bus."""
        return bool(self.shared.acknowledged)

    @acknowledged.setter
    def acknowledged(self, acknowledged: bool) -> None:
        self.shared.acknowledged = acknowledged

    @property
    def damaged_transmissions(self) -> int:
        """How many of the next attempts another node destroys."""
        return int(self.shared.damaged_transmissions)

    @damaged_transmissions.setter
    def damaged_transmissions(self, count: int) -> None:
        self.shared.damaged_transmissions = count

    @property
    def tec(self) -> int:
        """Transmit error counter."""
        return int(self.shared.tec)

    @property
    def bus_off(self) -> bool:
        """The controller has left the bus."""
        return bool(self.shared.bus_off)

    def receive(self, identifier: int, data: bytes) -> None:
        """Another node wants to send a frame."""
        lib.can_receive(self.shared, identifier, data, len(data))

    # --- modes (30.4) -------------------------------------------------------------------------------

    @property
    def initialising(self) -> bool:
        """INAK."""
        return bool(self.value["MSR"] & INAK)

    @property
    def bit_cycles(self) -> int:
        """Processor cycles a bit: (BRP + 1) * (1 + TS1 + 1 + TS2 + 1) bus clock cycles (30.7.7)."""
        return int(lib.can_bit_cycles(self.shared))

    @property
    def bit_rate(self) -> float:
        """Bits a second."""
        return self.soc.schedule.frequency / self.bit_cycles

    def write_mcr(self, value: int) -> None:
        """Requests for initialisation and sleep; normal mode is entered after 11 recessive bits (30.4.2)."""
        old, self.value["MCR"] = self.value["MCR"], value
        if value & SLEEP and value & INRQ:
            # Sleep is left by clearing SLEEP alone (30.4.3): no INAK. Of other modes the manual says nothing.
            if not self.value["MSR"] & SLAK:
                raise self.unmodelled("INRQ with SLEEP", "MCR", 0, value)
        elif value & INRQ:
            self.value["MSR"] = self.value["MSR"] & ~SLAK | INAK
        elif value & SLEEP:
            self.value["MSR"] = self.value["MSR"] & ~INAK | SLAK
        elif old & (INRQ | SLEEP):
            self.value["MSR"] &= ~SLAK
            bits = RECOVERY_BITS if self.bus_off else 11
            self.soc.schedule.after(bits * self.bit_cycles, self._synchronised)

    def _synchronised(self) -> None:
        if not self.value["MCR"] & (INRQ | SLEEP):
            self.value["MSR"] &= ~INAK
            if self.bus_off and not self.shared.recovering:
                lib.can_recovered(self.shared)
            lib.can_arbitrate(self.shared)

    def write_msr(self, value: int) -> None:
        """ERRI is cleared by writing a one."""
        self.value["MSR"] &= ~(value & ERRI)
        lib.can_update_lines(self.shared)

    def write_btr(self, value: int) -> None:
        """Bit timing, in initialisation mode only."""
        if not self.initialising:
            raise self.violation("BTR written outside initialisation mode", "30.9.2")
        if value >> 30 not in (0, 1, 3):
            raise self.unmodelled("silent mode without loopback", "BTR", 0x1C, value)
        self.value["BTR"] = value

    # --- registers ----------------------------------------------------------------------------------

    def read_rf0r(self) -> int:
        """FMP, FULL, FOVR."""
        return int(lib.can_read_fifo(self.shared, 0))

    def write_rf0r(self, value: int) -> None:
        """RFOM gives the oldest frame back; ones clear FULL and FOVR."""
        lib.can_write_fifo(self.shared, 0, value)

    def write_ier(self, value: int) -> None:
        """Interrupt enables."""
        self.value["IER"] = value
        lib.can_update_lines(self.shared)

    def _write_filter_register(self, register: str, value: int) -> None:
        if register != "FA1R" and not self.value["FMR"] & 1:
            raise self.violation(f"{register} written outside filter initialisation", "30.9.4")
        self.value[register] = value

    def write_fm1r(self, value: int) -> None:
        """Mask or list, by bank."""
        self._write_filter_register("FM1R", value)

    def write_fs1r(self, value: int) -> None:
        """Scale, by bank."""
        self._write_filter_register("FS1R", value)

    def write_ffa1r(self, value: int) -> None:
        """FIFO, by bank."""
        self._write_filter_register("FFA1R", value)

    # --- errors (30.7.6), mailboxes and filter banks --------------------------------------------------

    def read_esr(self) -> int:
        """Error counters, last error code, state."""
        return int(lib.can_read_esr(self.shared))

    def write_esr(self, value: int) -> None:
        """LEC may be written (to 7) to see the next change."""
        self.value["ESR"] = self.value["ESR"] & ~0x70 | value & 0x70

    def write(self, offset: int, size: int, value: int) -> None:
        """Filter banks from 0x240; of mailboxes what can.c does not take: other kinds of frames."""
        if self._write_shared(offset, size, value):
            return
        bank, word = divmod(offset - 0x240, 8)
        if size != 4 or not 0 <= bank < FILTERS:
            super().write(offset, size, value)
            return
        if self.value["FA1R"] >> bank & 1 and not self.value["FMR"] & 1:
            raise self.violation(f"filter bank {bank} written while active", "30.9.4")
        self.shared.filters[bank][word >> 2] = value


def _frame(frame: CData) -> Frame:
    return Frame(int(frame.identifier), bytes(frame.data[0 : frame.length]))
