"""Controller area network bxCAN (RM0390 chapter 30): one controller and the bus it sits on.

Frames pass whole. A frame takes as long as the most stuff bits allow; whether it is acknowledged, or damaged
so that error counters move as ISO 11898-1 says, is decided by the bus that a test sets up.
"""

from collections import deque
from typing import TYPE_CHECKING, ClassVar

from hil_sim.board.elf.can_frame import Frame, Mailbox, frame_bits
from hil_sim.board.elf.registers import ALL, Peripheral, Register
from hil_sim.board.elf.schedule import Event

if TYPE_CHECKING:
    from hil_sim.board.elf.soc import Soc

INRQ, SLEEP, TXFP, RFLM, NART, ABOM, DBF = 1 << 0, 1 << 1, 1 << 2, 1 << 3, 1 << 4, 1 << 6, 1 << 16
INAK, SLAK, ERRI = 1 << 0, 1 << 1, 1 << 2
TMEIE, FMPIE0, FFIE0, FOVIE0, FMPIE1 = 1 << 0, 1 << 1, 1 << 2, 1 << 3, 1 << 4
EWGIE, EPVIE, BOFIE, LECIE, ERRIE = 1 << 8, 1 << 9, 1 << 10, 1 << 11, 1 << 15
EWGF, EPVF, BOFF = 1 << 0, 1 << 1, 1 << 2
LEC_ACK, LEC_BIT_RECESSIVE = 3, 4
INTERRUPTS = TMEIE | FMPIE0 | FFIE0 | FOVIE0 | FMPIE1 | EWGIE | EPVIE | BOFIE | LECIE | ERRIE
TXRQ, RTR, IDE = 1 << 0, 1 << 1, 1 << 2
MAILBOXES = 3
FIFO_DEPTH = 3
FILTERS = 28
RECOVERY_BITS = 128 * 11  # 30.7.6
WARNING, PASSIVE, BUS_OFF = 96, 128, 256
IRQ_TX, IRQ_RX0, IRQ_RX1, IRQ_SCE = 19, 20, 21, 22


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
        Register("BTR", 0x1C, "30.9.2", 0x0123_0000, 0x037F_03FF),
        Register("FMR", 0x200, "30.9.4", 0x2A1C_0E01, 0x3F01),
        Register("FM1R", 0x204, "30.9.4", 0, (1 << FILTERS) - 1),
        Register("FS1R", 0x20C, "30.9.4", 0, (1 << FILTERS) - 1),
        Register("FFA1R", 0x214, "30.9.4", 0, (1 << FILTERS) - 1),
        Register("FA1R", 0x21C, "30.9.4", 0, (1 << FILTERS) - 1),
    )  # fmt: skip

    def __init__(self, name: str, base: int, soc: "Soc") -> None:
        super().__init__(name, base, soc)
        self.mailboxes = [Mailbox() for _ in range(MAILBOXES)]
        self.fifos: tuple[deque[Frame], deque[Frame]] = (deque(maxlen=FIFO_DEPTH), deque(maxlen=FIFO_DEPTH))
        self.filters = [[0, 0] for _ in range(FILTERS)]
        self.sent: list[Frame] = []
        self.acknowledged = True
        self.damaged_transmissions = 0  # how many of the next attempts another node destroys
        self.tec = 0
        self.rec = 0
        self.bus_off = False
        self._sending: int | None = None
        self._requests = 0
        self._to_receive: deque[Frame] = deque()
        self._bus_event: Event | None = None
        self._recovering: Event | None = None

    # --- modes (30.4) -------------------------------------------------------------------------------

    @property
    def initialising(self) -> bool:
        """INAK."""
        return bool(self.value["MSR"] & INAK)

    @property
    def active(self) -> bool:
        """Takes part in the bus."""
        return not self.value["MSR"] & (INAK | SLAK) and not self.bus_off

    @property
    def bit_cycles(self) -> int:
        """Processor cycles a bit: (BRP + 1) * (1 + TS1 + 1 + TS2 + 1) bus clock cycles (30.7.7)."""
        btr = self.value["BTR"]
        quanta = 3 + (btr >> 16 & 15) + (btr >> 20 & 7)
        return ((btr & 0x3FF) + 1) * quanta * self.soc.rcc.bus_divider(1)

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
            if self.bus_off and self._recovering is None:
                self._recovered()
            self._arbitrate()

    def write_msr(self, value: int) -> None:
        """ERRI is cleared by writing a one."""
        self.value["MSR"] &= ~(value & ERRI)
        self._update_lines()

    def write_btr(self, value: int) -> None:
        """Bit timing, in initialisation mode only."""
        if not self.initialising:
            raise self.violation("BTR written outside initialisation mode", "30.9.2")
        self.value["BTR"] = value

    # --- transmission (30.7.1) ----------------------------------------------------------------------

    def _next_mailbox(self) -> int | None:
        """The pending mailbox that goes first: by order of request with TXFP, else by identifier."""
        pending = [n for n, box in enumerate(self.mailboxes) if box.words[0] & TXRQ]
        if not pending:
            return None
        if self.value["MCR"] & TXFP:
            return min(pending, key=lambda n: self.mailboxes[n].order)
        return min(pending, key=lambda n: (self.mailboxes[n].words[0] >> 21, n))

    def _arbitrate(self) -> None:
        """The bus is free: the lowest identifier of what anybody wants to send wins it."""
        if not self.active or self._bus_event is not None:
            return
        box = self._next_mailbox()
        other = self._to_receive[0] if self._to_receive else None
        if box is not None and (other is None or self.mailboxes[box].frame.identifier < other.identifier):
            self._sending = box
            frame = self.mailboxes[box].frame
        elif other is not None:
            self._sending = None
            frame = other
        else:
            return
        cycles = frame_bits(len(frame.data)) * self.bit_cycles
        self._bus_event = self.soc.schedule.after(cycles, self._frame_ends)

    def _frame_ends(self) -> None:
        self._bus_event = None
        if self._sending is not None:
            self._transmitted(self._sending)
            self._sending = None
        elif self._to_receive:
            self._accept(self._to_receive.popleft())
        self._arbitrate()
        self._update_lines()

    def _transmitted(self, number: int) -> None:
        if not self.soc.routed(f"{self.name}_TX"):
            raise self.violation("transmission while no pin is switched to TX", "7.3.2")
        box = self.mailboxes[number]
        if self.damaged_transmissions:
            self.damaged_transmissions -= 1
            self._failed(number, LEC_BIT_RECESSIVE, 8)
        elif not self.acknowledged:
            # A node that is alone goes to error passive and no further (ISO 11898-1 fault confinement).
            self._failed(number, LEC_ACK, 8 if self.tec < PASSIVE else 0)
        else:
            self.sent.append(box.frame)
            self.tec = max(0, self.tec - 1)
            self._release(number, 0b011)  # RQCP, TXOK
            self._counters_changed(0)

    def _failed(self, number: int, lec: int, penalty: int) -> None:
        self.tec += penalty
        if self.value["MCR"] & NART:
            self._release(number, 0b1001)  # RQCP, TERR
        self._counters_changed(lec)

    def _release(self, number: int, status: int) -> None:
        self.mailboxes[number].words[0] &= ~TXRQ
        shift = 8 * number
        self.value["TSR"] = self.value["TSR"] & ~(0xFF << shift) | status << shift

    def read_tsr(self) -> int:
        """TME by mailbox, CODE of the next free one, LOW flags not modelled (read as 0)."""
        empty = [not box.words[0] & TXRQ for box in self.mailboxes]
        value = self.value["TSR"] & 0x000F_0F0F
        value |= sum(free << (26 + number) for number, free in enumerate(empty))
        if any(empty):
            return value | empty.index(True) << 24
        last = max(range(MAILBOXES), key=lambda n: (self.mailboxes[n].words[0] >> 21, n))
        return value | last << 24

    def write_tsr(self, value: int) -> None:
        """Writing a one to RQCP clears the mailbox's result flags; ABRQ takes a waiting frame back."""
        for number in range(MAILBOXES):
            shift = 8 * number
            if value >> shift & 1:
                self.value["TSR"] &= ~(0x0F << shift)
            if value >> shift & 0x80 and self.mailboxes[number].words[0] & TXRQ and self._sending != number:
                self._release(number, 0b0001)
        self._update_lines()

    # --- reception and filters (30.7.3, 30.7.4) -----------------------------------------------------

    def receive(self, identifier: int, data: bytes) -> None:
        """Another node wants to send a frame."""
        self._to_receive.append(Frame(identifier, data))
        self._arbitrate()

    def _accept(self, frame: Frame) -> None:
        self.rec = max(0, self.rec - 1) if self.rec < PASSIVE else PASSIVE - 1
        if not self.soc.routed(f"{self.name}_RX"):
            return
        fifo = self._filter(frame)
        if fifo is None:
            return
        register = f"RF{fifo}R"
        if len(self.fifos[fifo]) == FIFO_DEPTH:
            self.value[register] |= 1 << 4  # FOVR
            if not self.value["MCR"] & RFLM:
                self.fifos[fifo][-1] = frame
        else:
            self.fifos[fifo].append(frame)
            if len(self.fifos[fifo]) == FIFO_DEPTH:
                self.value[register] |= 1 << 3  # FULL

    def _filter(self, frame: Frame) -> int | None:
        """FIFO of the first active bank that lets the frame pass; 32-bit scale only."""
        word = frame.identifier << 21
        if self.value["FMR"] & 1:
            return None  # no reception while the filters are being set up (30.9.4)
        for bank, (first, second) in enumerate(self.filters):
            if not self.value["FA1R"] >> bank & 1:
                continue
            if not self.value["FS1R"] >> bank & 1:
                raise self.unmodelled("filter of 16 bits", "FS1R", 0x20C, 1 << bank)
            listed = bool(self.value["FM1R"] >> bank & 1)
            if word in (first, second) if listed else not (word ^ first) & second & ~1:
                return self.value["FFA1R"] >> bank & 1
        return None

    def _read_fifo_register(self, fifo: int) -> int:
        return len(self.fifos[fifo]) | self.value[f"RF{fifo}R"] & 0x18

    def _write_fifo_register(self, fifo: int, value: int) -> None:
        self.value[f"RF{fifo}R"] &= ~(value & 0x18)
        if value & 0x20 and self.fifos[fifo]:
            self.fifos[fifo].popleft()  # RFOM
            self.value[f"RF{fifo}R"] &= ~0x08
        self._update_lines()

    def read_rf0r(self) -> int:
        """FMP, FULL, FOVR."""
        return self._read_fifo_register(0)

    def read_rf1r(self) -> int:
        """As RF0R."""
        return self._read_fifo_register(1)

    def write_rf0r(self, value: int) -> None:
        """RFOM gives the oldest frame back; ones clear FULL and FOVR."""
        self._write_fifo_register(0, value)

    def write_rf1r(self, value: int) -> None:
        """As RF0R."""
        self._write_fifo_register(1, value)

    def write_ier(self, value: int) -> None:
        """Interrupt enables."""
        self.value["IER"] = value
        self._update_lines()

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

    # --- fault confinement (30.7.6) -----------------------------------------------------------------

    def _counters_changed(self, lec: int) -> None:
        esr = self.value["ESR"]
        before = esr & 7
        flags = (self.tec >= WARNING or self.rec >= WARNING) | (
            self.tec >= PASSIVE or self.rec >= PASSIVE
        ) << 1
        if self.tec >= BUS_OFF:
            self.bus_off = True
            flags |= BOFF
            if self.value["MCR"] & ABOM and self._recovering is None:
                self._recovering = self.soc.schedule.after(RECOVERY_BITS * self.bit_cycles, self._recovered)
        self.value["ESR"] = flags | lec << 4
        news, ier = flags & ~before, self.value["IER"]
        enabled = (
            (news & EWGF and ier & EWGIE) or (news & EPVF and ier & EPVIE) or (news & BOFF and ier & BOFIE)
        )
        if enabled or (lec and ier & LECIE):
            self.value["MSR"] |= ERRI
        self._update_lines()

    def _recovered(self) -> None:
        """128 times eleven recessive bits have passed: error active again."""
        self._recovering = None
        self.bus_off = False
        self.tec = self.rec = 0
        self._counters_changed(0)
        self._arbitrate()

    def read_esr(self) -> int:
        """Error counters, last error code, state."""
        return self.value["ESR"] | min(self.tec, 255) << 16 | min(self.rec, 255) << 24

    def write_esr(self, value: int) -> None:
        """LEC may be written (to 7) to see the next change."""
        self.value["ESR"] = self.value["ESR"] & ~0x70 | value & 0x70

    # --- mailboxes and filter banks on the bus ------------------------------------------------------

    def read(self, offset: int, size: int) -> int:
        """Transmit mailboxes from 0x180, receive mailboxes from 0x1B0, filter banks from 0x240."""
        if size != 4 or offset < 0x180 or 0x1D0 <= offset < 0x240:
            return super().read(offset, size)
        if offset < 0x1B0:
            number, word = divmod(offset - 0x180, 16)
            return self.mailboxes[number].words[word >> 2]
        if offset < 0x1D0:
            fifo, word = divmod(offset - 0x1B0, 16)
            return self._receive_word(fifo, word >> 2)
        bank, word = divmod(offset - 0x240, 8)
        return self.filters[bank][word >> 2] if bank < FILTERS else super().read(offset, size)

    def _receive_word(self, fifo: int, word: int) -> int:
        if not self.fifos[fifo]:
            raise self.violation(f"receive FIFO {fifo} read while empty", "30.9.3")
        frame = self.fifos[fifo][0]
        data = int.from_bytes(frame.data.ljust(8, b"\0"), "little")
        return (frame.identifier << 21, len(frame.data), data & ALL, data >> 32)[word]

    def write(self, offset: int, size: int, value: int) -> None:
        """As read; the receive mailboxes are read-only."""
        if size != 4 or offset < 0x180 or 0x1B0 <= offset < 0x240:
            super().write(offset, size, value)
        elif offset < 0x1B0:
            number, word = divmod(offset - 0x180, 16)
            self._write_mailbox(number, word >> 2, value)
        else:
            bank, word = divmod(offset - 0x240, 8)
            if bank >= FILTERS:
                raise self.unmodelled("write", "?", offset, value)
            if self.value["FA1R"] >> bank & 1 and not self.value["FMR"] & 1:
                raise self.violation(f"filter bank {bank} written while active", "30.9.4")
            self.filters[bank][word >> 2] = value

    def _write_mailbox(self, number: int, word: int, value: int) -> None:
        box = self.mailboxes[number]
        if box.words[0] & TXRQ:
            raise self.violation(f"transmit mailbox {number} written while it waits to send", "30.7.1")
        if word == 0 and value & (IDE | RTR):
            raise self.unmodelled("write", f"TI{number}R", 0x180 + 16 * number, value & (IDE | RTR))
        if word == 1 and value & ~0xF:
            raise self.unmodelled("write", f"TDT{number}R", 0x184 + 16 * number, value & ~0xF)
        box.words[word] = value
        if word == 0 and value & TXRQ:
            self._requests += 1
            box.order = self._requests
            self.value["TSR"] &= ~(0x0F << 8 * number)  # a new request clears RQCP
            self._arbitrate()
            self._update_lines()

    def _update_lines(self) -> None:
        ier, set_line = self.value["IER"], self.soc.nvic.set_line
        set_line(IRQ_TX, bool(ier & TMEIE and self.value["TSR"] & 0x0001_0101))
        for fifo, irq in ((0, IRQ_RX0), (1, IRQ_RX1)):
            enables, flags = ier >> 3 * fifo, self.value[f"RF{fifo}R"]
            pending = self.fifos[fifo] and enables & FMPIE0
            pending = pending or (flags & 8 and enables & FFIE0) or (flags & 16 and enables & FOVIE0)
            set_line(irq, bool(pending))
        set_line(IRQ_SCE, bool(ier & ERRIE and self.value["MSR"] & ERRI))
