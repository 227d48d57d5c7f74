"""The STM32F446RE as far as it is modelled: processor, buses, peripherals, and the wires between them.

Time advances by events. While the processor sleeps the clock jumps to the next event; while it runs, it is
stopped before the block of instructions that would begin after the next event. An interrupt enters between
two blocks, never within one: at most a few hundred nanoseconds late. The loop itself is in run.c.
"""

from collections.abc import Callable

from hil_sim.board.elf import dma as dma_model
from hil_sim.board.elf.adc import AdcPair
from hil_sim.board.elf.can import Can
from hil_sim.board.elf.chip import CData, ffi, lib
from hil_sim.board.elf.cpu import NO_WATCH, Cpu
from hil_sim.board.elf.errors import UnmodelledAccess
from hil_sim.board.elf.flash import Flash
from hil_sim.board.elf.gpio import ANALOG, Gpio
from hil_sim.board.elf.iwdg import Iwdg
from hil_sim.board.elf.memory import FLASH_BASE, Memory
from hil_sim.board.elf.nvic import Nvic
from hil_sim.board.elf.pulse_timer import PulseTimer
from hil_sim.board.elf.pwr import Pwr
from hil_sim.board.elf.rcc import GATES, HSI_HZ, Rcc
from hil_sim.board.elf.registers import Peripheral
from hil_sim.board.elf.scb import Scb
from hil_sim.board.elf.schedule import Schedule
from hil_sim.board.elf.signature import Signature
from hil_sim.board.elf.spi import Spi
from hil_sim.board.elf.systick import SysTick
from hil_sim.board.elf.tim11 import Tim11
from hil_sim.board.elf.timer import Timer
from hil_sim.board.elf.usart import Usart

BUS_BASE, BUS_SIZE = 0x4000_0000, 0x8_0000
SYSTEM_MEMORY = 0x1FFF_7000
SCS_BASE = 0xE000_E000  # system control space: SysTick, NVIC, SCB
PAGE = 0x400
# Memory map (RM0390 2.2.2) and vector table (10.1.3).
TIMERS = {
    "TIM2": (0x4000_0000, 28), "TIM3": (0x4000_0400, 29), "TIM4": (0x4000_0800, 30),
    "TIM5": (0x4000_0C00, 50), "TIM12": (0x4000_1800, 43),
}  # fmt: skip
DMAS = {
    "DMA1": (0x4002_6000, (11, 12, 13, 14, 15, 16, 17, 47)),
    "DMA2": (0x4002_6400, (56, 57, 58, 59, 60, 68, 69, 70)),
}
PORTS = {"A": 0x4002_0000, "B": 0x4002_0400, "C": 0x4002_0800, "H": 0x4002_1C00}
# Pins that can carry each signal (data sheet, alternate functions): (port, pin, alternate function).
PINS = {
    "TIM2_CH1": (("A", 0, 1), ("A", 5, 1), ("A", 15, 1)),
    "TIM2_CH2": (("A", 1, 1), ("B", 3, 1)),
    "TIM5_CH1": (("A", 0, 2),),
    "TIM5_CH2": (("A", 1, 2),),
    "TIM4_CH1": (("B", 6, 2),),
    "TIM3_CH1": (("A", 6, 2), ("B", 4, 2), ("C", 6, 2)),
    "USART2_TX": (("A", 2, 7),),
    "USART2_RX": (("A", 3, 7),),
    "CAN1_RX": (("B", 8, 9), ("A", 11, 9)),
    "CAN1_TX": (("B", 9, 9), ("A", 12, 9)),
    "SPI2_SCK": (("B", 10, 5), ("B", 13, 5)),
    "SPI2_MISO": (("B", 14, 5), ("C", 2, 5)),
    "SPI2_MOSI": (("B", 15, 5), ("C", 3, 5)),
    "TIM1_CH2": (("A", 9, 1),),
}
SIGNALS = list(PINS)  # in the order of their numbers in the C part
# ADC12_IN0 to ADC12_IN15 (data sheet, pin definitions).
ANALOG_PINS = {
    **{n: ("A", n) for n in range(8)}, 8: ("B", 0), 9: ("B", 1), **{10 + n: ("C", n) for n in range(6)}
}  # fmt: skip


class Soc:
    """A chip with a program in its flash.

    `memory` outlives a reset, as the hardware's does; everything else starts anew.

    Args:
        hse_bypass: what drives the oscillator's pin: a clock signal, which needs HSEBYP (True), a crystal,
            which needs it off (False), or whichever of the two the program asks for (None).

    `wired` names the pin of each signal that the world is connected to; others come over any of their pins.
    """

    def __init__(
        self,
        memory: Memory,
        uid: tuple[int, int, int] = (1, 2, 3),
        hse_present: bool = True,
        reset_cause: str = "power",
        hse_bypass: bool | None = None,
    ) -> None:
        self.memory = memory
        self.uid = uid
        self.hse_present = hse_present
        self.hse_bypass = hse_bypass
        self.hsi_hz = HSI_HZ  # of this chip; from the next reset on
        self.wired: dict[str, tuple[str, int]] = {}
        self.cpu = Cpu(memory)
        self.chip: CData = self.cpu.chip
        self._handle = ffi.new_handle(self)
        self.chip.handle = self._handle
        self.clock = self.cpu.clock
        self.schedule = Schedule(self.chip)
        self.schedule.start(0, 0.0, self.hsi_hz)
        self.on_reset: Callable[[], None] = lambda: None
        self._on_exception: Callable[[int, bool], None] | None = None
        self.resets: list[str] = []
        self.stop_at_reset = False
        self.in_reset = False
        self.reset_flags = 0
        self._reset_cause: str | None = None
        self._build(reset_cause)
        self.cpu.map_bus(BUS_BASE, BUS_SIZE)
        self.cpu.map_peripherals(SYSTEM_MEMORY, 0x1000, self._cpu_read, self._cpu_write)
        self.cpu.map_peripherals(SCS_BASE, 0x1000, self._cpu_read, self._cpu_write)
        self.cpu.on_flash_write(self._program)
        self.cpu.on_unreadable(self._unreadable)

    def _build(self, reset_cause: str) -> None:
        """Every peripheral in its reset state, then the processor out of reset."""
        self.chip.sleeping = 0
        self._clocked: set[Peripheral] = set()  # banks known to have a clock
        self._dma_resume: list[tuple[str, Callable[[], None]]] = []
        self.nvic = Nvic(SCS_BASE, self)
        self.scb = Scb("SCB", SCS_BASE, self)
        self.systick = SysTick(SCS_BASE, self)
        self.rcc = Rcc(0x4002_3800, self, reset_cause)
        self.pwr = Pwr("PWR", 0x4000_7000, self)
        self.flash = Flash(0x4002_3C00, self)
        self.gpio = {letter: Gpio(letter, base, self) for letter, base in PORTS.items()}
        self.timers = {name: Timer(name, base, self, irq) for name, (base, irq) in TIMERS.items()}
        self.timer_list = list(self.timers.values())  # in the order of their numbers in the C part
        self.dmas = {name: dma_model.Dma(name, base, self, irqs) for name, (base, irqs) in DMAS.items()}
        self.adc = AdcPair(0x4001_2000, self)
        self.usart2 = Usart("USART2", 0x4000_4400, self, 38)
        self.can1 = Can("CAN1", 0x4000_6400, self)
        self.iwdg = Iwdg(0x4000_3000, self)
        self.tim11 = Tim11(0x4001_4800, self)
        self.spi2 = Spi("SPI2", 0x4000_3800, self)
        self.tim1 = PulseTimer("TIM1", 0x4001_0000, self)
        self.signature = Signature(SYSTEM_MEMORY, self, self.uid)
        banks: list[Peripheral] = [
            self.rcc, self.pwr, self.flash, self.adc, self.usart2, self.can1, self.iwdg,
            self.tim11, self.spi2, self.tim1,
            *self.gpio.values(), *self.timers.values(), *self.dmas.values(),
        ]  # fmt: skip
        self._pages = {bank.base // PAGE: bank for bank in banks}
        for source, resume in self._dma_resume:
            name, stream, channel = dma_model.REQUESTS[source]
            self.dmas[name].on_start(stream, channel, resume)
        self._connect(banks)
        self.reset_flags = self.rcc.value["CSR"]
        self.cpu.reset(FLASH_BASE)

    def _connect(self, banks: list[Peripheral]) -> None:
        """Shows the C part its peripherals."""
        chip = self.chip
        chip.vectors = FLASH_BASE
        chip.gpios = [port.shared for port in self.gpio.values()]
        chip.timers = [timer.shared for timer in self.timer_list]
        chip.dmas = [dma.shared for dma in self.dmas.values()]
        chip.adc, chip.usart, chip.can = self.adc.shared, self.usart2.shared, self.can1.shared
        chip.iwdg = self.iwdg.shared
        chip.pages = [ffi.NULL] * len(chip.pages)
        for bank in banks:
            if bank.shared is not None:
                chip.pages[(bank.base - BUS_BASE) // PAGE] = ffi.addressof(bank.shared, "bank")
        self._shared_banks = [bank for bank in banks if bank.shared is not None]
        self.pins_changed()
        self.gates_changed()

    def take_from_c(self, bank: Peripheral) -> None:
        """Every access to it comes to Python first."""
        self.chip.pages[(bank.base - BUS_BASE) // PAGE] = ffi.NULL

    # --- what holds the processor -------------------------------------------------------------------

    @property
    def sleeping(self) -> bool:
        """WFI waits for an interrupt."""
        return bool(self.chip.sleeping)

    @property
    def thread_held(self) -> bool:
        """The main loop stands still, as a test asked."""
        return bool(self.chip.thread_held)

    @thread_held.setter
    def thread_held(self, held: bool) -> None:
        self.chip.thread_held = held

    @property
    def interrupts_held(self) -> bool:
        """No interrupt enters, as a test asked."""
        return bool(self.chip.interrupts_held)

    @interrupts_held.setter
    def interrupts_held(self, held: bool) -> None:
        self.chip.interrupts_held = held

    @property
    def on_exception(self) -> Callable[[int, bool], None] | None:
        """Called with each exception that is entered (True) or left (False)."""
        return self._on_exception

    @on_exception.setter
    def on_exception(self, watcher: Callable[[int, bool], None] | None) -> None:
        self._on_exception = watcher
        self.chip.watched = watcher is not None

    # --- buses --------------------------------------------------------------------------------------

    @property
    def pc(self) -> int:
        """Address of the block of instructions that runs or ran last."""
        return int(self.clock.block_pc)

    def _bank(self, address: int) -> Peripheral:
        if address >= SCS_BASE:
            offset = address - SCS_BASE
            if offset < 0x100:
                return self.systick
            return self.nvic if offset < 0xD00 else self.scb
        if address < BUS_BASE:
            return self.signature
        bank = self._pages.get(address // PAGE)
        if bank is None:
            raise UnmodelledAccess("access", "?", "?", address, 0, self.pc)
        return bank

    def _gated(self, bank: Peripheral) -> bool:
        names = ("ADC1", "ADC2") if bank is self.adc else (bank.name,)
        return any(name in GATES and self.rcc.gated(name) for name in names)

    def _check_clock(self, bank: Peripheral) -> None:
        if bank not in self._clocked:
            if self._gated(bank):
                raise bank.violation("accessed while its clock is gated", "6.2")
            self._clocked.add(bank)

    def peripheral(self, address: int) -> tuple[Peripheral, int]:
        """The bank at a bus address, and the offset in it.

        Raises:
            UnmodelledAccess: there is no model at this address.
            RuleViolation: its clock is off.
        """
        bank = self._bank(address)
        self._check_clock(bank)
        return bank, address - bank.base

    def bus_read(self, address: int, size: int) -> int:
        """A read by the processor or the DMA."""
        bank, offset = self.peripheral(address)
        return bank.read(offset, size)

    def bus_write(self, address: int, size: int, value: int) -> None:
        """A write by the processor or the DMA."""
        bank, offset = self.peripheral(address)
        bank.write(offset, size, value)

    def _cpu_read(self, address: int, size: int) -> int:
        self.schedule.fire(self.clock.cycles)  # what is due before this access has happened before it
        return self.bus_read(address, size)

    def _cpu_write(self, address: int, size: int, value: int) -> None:
        self.schedule.fire(self.clock.cycles)
        self.bus_write(address, size, value)
        self.clock.deadline = min(self.clock.deadline, lib.schedule_next(self.chip))

    def _program(self, address: int, size: int, value: int) -> None:
        self.flash_touched()
        self.flash.program(address, size, value)

    def _unreadable(self, address: int) -> None:
        self.flash.refuse_stale_read(address)

    def flash_touched(self) -> None:
        """The flash has business with the memory once the processor stands still."""
        self.chip.flash_touched = 1

    def settle(self) -> None:
        """That business: what was programmed, and what may be read."""
        self.flash.settle()
        self.cpu.set_unreadable(self.flash.stale)

    # --- wires --------------------------------------------------------------------------------------

    def on_dma_start(self, source: str, resume: Callable[[], None]) -> None:
        """A source that keeps asking until its stream is enabled."""
        self._dma_resume.append((source, resume))

    def routed(self, signal: str) -> bool:
        """A pin is switched to the signal."""
        return bool(lib.chip_route(self.chip, self.signal(signal)))

    def signal(self, name: str) -> int:
        """The number of a signal in the C part."""
        return SIGNALS.index(name)

    def find_route(self, number: int) -> bool:
        """As `routed`, looked up anew, by the signal's number."""
        signal = SIGNALS[number]
        return any(
            self.gpio[port].alternate(pin) == function
            for port, pin, function in PINS[signal]
            if self.wired.get(signal, (port, pin)) == (port, pin)
        )

    def analog_input(self, channel: int) -> bool:
        """The channel's pin is in analogue mode."""
        port, pin = ANALOG_PINS[channel]
        return self.gpio[port].mode(pin) == ANALOG

    # --- changes that reach beyond a peripheral -----------------------------------------------------

    def gates_changed(self) -> None:
        """A clock was switched on or off, or divided."""
        self._clocked.clear()
        chip = self.chip
        chip.apb1, chip.apb2 = self.rcc.bus_divider(1), self.rcc.bus_divider(2)
        chip.timer_divider = self.rcc.timer_divider(1)
        for bank in self._shared_banks:
            bank.shared.bank.clocked = not self._gated(bank)

    def pins_changed(self) -> None:
        """A pin may have got another function."""
        self.chip.routes = [-1] * len(self.chip.routes)

    def interrupts_changed(self) -> None:
        """Looks at the pending interrupts before the next block."""
        self.clock.deadline = 0

    def clocks_changed(self, hclk: float) -> None:
        """The system clock has another frequency from now on."""
        self.schedule.set_frequency(hclk)

    def stall(self, seconds: float) -> None:
        """The processor cannot fetch for a while; everything else goes on."""
        self.clock.cycles += self.schedule.cycles_for(seconds)
        self.clock.deadline = 0

    def request_reset(self, cause: str) -> None:
        """System reset before the next block."""
        self._reset_cause = cause
        self.chip.reset_requested = 1
        self.clock.deadline = 0

    def _reset(self, cause: str) -> None:
        self._reset_cause = None
        self.chip.reset_requested = 0
        self.resets.append(cause)
        self.schedule.start(self.clock.cycles, self.schedule.seconds(), self.hsi_hz)
        self.clock.watch_priority = NO_WATCH
        left = self.usart2.sent, self.can1.sent  # what is on the wire no reset calls back
        self._build(cause)
        self.usart2.sent, self.can1.sent = left
        self.in_reset = self.stop_at_reset
        self.on_reset()

    # --- running ------------------------------------------------------------------------------------

    def run_until(self, cycle: int) -> None:
        """Runs the chip until (just past) a cycle."""
        while not self._stands(cycle) and self._resets(lib.chip_run_until(self.chip, cycle)):
            pass

    def run_for(self, seconds: float) -> None:
        """Runs the chip for a stretch of time; the processor's clock may change meanwhile."""
        end = self.schedule.seconds() + seconds
        while not self._stands(self.schedule.cycle_at(end)) and self._resets(
            lib.chip_run_for(self.chip, end)
        ):
            pass

    def _stands(self, cycle: int) -> bool:
        """A chip in reset lets time pass, until a cycle."""
        if self.in_reset:
            self.clock.cycles = max(self.clock.cycles, cycle)
            self.schedule.fire(self.clock.cycles)
        return self.in_reset

    def _resets(self, status: int) -> bool:
        """What the C part came back for: whether the chip was reset and is to run on."""
        if status == lib.CHIP_DONE:
            return False
        if status != lib.CHIP_RESET or self._reset_cause is None:
            raise self.cpu.error()
        self._reset(self._reset_cause)
        return True
