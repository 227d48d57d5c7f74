"""The STM32F446RE as far as it is modelled: processor, buses, peripherals, and the wires between them.

Time advances by events. While the processor sleeps the clock jumps to the next event; while it runs, it is
stopped before the block of instructions that would begin after the next event. An interrupt enters between
two blocks, never within one: at most a few hundred nanoseconds late.
"""

from collections.abc import Callable

from hil_sim.board.elf import dma as dma_model
from hil_sim.board.elf.adc import AdcPair
from hil_sim.board.elf.can import Can
from hil_sim.board.elf.cpu import NO_WATCH, Cpu, Stop
from hil_sim.board.elf.errors import UnmodelledAccess
from hil_sim.board.elf.flash import Flash
from hil_sim.board.elf.gpio import ANALOG, Gpio
from hil_sim.board.elf.iwdg import Iwdg
from hil_sim.board.elf.memory import FLASH_BASE, Memory
from hil_sim.board.elf.nvic import THREAD, Nvic
from hil_sim.board.elf.pwr import Pwr
from hil_sim.board.elf.rcc import GATES, HSI_HZ, Rcc
from hil_sim.board.elf.registers import Peripheral
from hil_sim.board.elf.scb import Scb
from hil_sim.board.elf.schedule import Schedule
from hil_sim.board.elf.signature import Signature
from hil_sim.board.elf.systick import SysTick
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
    "USART2_TX": (("A", 2, 7),),
    "USART2_RX": (("A", 3, 7),),
    "CAN1_RX": (("B", 8, 9), ("A", 11, 9)),
    "CAN1_TX": (("B", 9, 9), ("A", 12, 9)),
}
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
        self.wired: dict[str, tuple[str, int]] = {}
        self.cpu = Cpu(memory)
        self.clock = self.cpu.clock
        self.schedule = Schedule(HSI_HZ)
        self.on_reset: Callable[[], None] = lambda: None
        self.on_exception: Callable[[int, bool], None] | None = None
        self.resets: list[str] = []
        self.stop_at_reset = False
        self.in_reset = False
        self.reset_flags = 0
        self.thread_held = False
        self.interrupts_held = False
        self._reset_cause: str | None = None
        self._build(reset_cause)
        self.cpu.map_peripherals(BUS_BASE, BUS_SIZE, self._cpu_read, self._cpu_write)
        self.cpu.map_peripherals(SYSTEM_MEMORY, 0x1000, self._cpu_read, self._cpu_write)
        self.cpu.map_peripherals(SCS_BASE, 0x1000, self._cpu_read, self._cpu_write)
        self.cpu.on_flash_write(self._program)
        self.cpu.on_unreadable(self._unreadable)

    def _build(self, reset_cause: str) -> None:
        """Every peripheral in its reset state, then the processor out of reset."""
        self.sleeping = False
        self._clocked: set[Peripheral] = set()  # banks known to have a clock
        self._routes: dict[str, bool] = {}  # signals known to have a pin, or none
        self._listeners: dict[str, list[Timer]] = {}  # timers by the one whose TRGO they take
        self._dma_resume: list[tuple[str, Callable[[], None]]] = []
        self.nvic = Nvic(SCS_BASE, self)
        self.scb = Scb("SCB", SCS_BASE, self)
        self.systick = SysTick(SCS_BASE, self)
        self.rcc = Rcc(0x4002_3800, self, reset_cause)
        self.pwr = Pwr("PWR", 0x4000_7000, self)
        self.flash = Flash(0x4002_3C00, self)
        self.gpio = {letter: Gpio(letter, base, self) for letter, base in PORTS.items()}
        self.timers = {name: Timer(name, base, self, irq) for name, (base, irq) in TIMERS.items()}
        self.dmas = {name: dma_model.Dma(name, base, self, irqs) for name, (base, irqs) in DMAS.items()}
        self.adc = AdcPair(0x4001_2000, self)
        self.usart2 = Usart("USART2", 0x4000_4400, self, 38)
        self.can1 = Can("CAN1", 0x4000_6400, self)
        self.iwdg = Iwdg(0x4000_3000, self)
        self.signature = Signature(SYSTEM_MEMORY, self, self.uid)
        banks: list[Peripheral] = [
            self.rcc, self.pwr, self.flash, self.adc, self.usart2, self.can1, self.iwdg,
            *self.gpio.values(), *self.timers.values(), *self.dmas.values(),
        ]  # fmt: skip
        self._pages = {bank.base // PAGE: bank for bank in banks}
        for source, resume in self._dma_resume:
            name, stream, channel = dma_model.REQUESTS[source]
            self.dmas[name].on_start(stream, channel, resume)
        self.reset_flags = self.rcc.value["CSR"]
        self.cpu.reset(FLASH_BASE)

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

    def _check_clock(self, bank: Peripheral) -> None:
        if bank not in self._clocked:
            names = ("ADC1", "ADC2") if bank is self.adc else (bank.name,)
            if any(name in GATES and self.rcc.gated(name) for name in names):
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

    def _cpu_read(self, address: int, size: int) -> int:
        self._catch_up()
        bank, offset = self.peripheral(address)
        return bank.read(offset, size)

    def _cpu_write(self, address: int, size: int, value: int) -> None:
        self._catch_up()
        bank, offset = self.peripheral(address)
        bank.write(offset, size, value)
        head = self.schedule.next_cycle()
        if head is not None and head < self.clock.deadline:
            self.clock.deadline = head

    def _program(self, address: int, size: int, value: int) -> None:
        self.flash.program(address, size, value)

    def _unreadable(self, address: int) -> None:
        self.flash.refuse_stale_read(address)

    def _catch_up(self) -> None:
        """What is due before this access has happened before it."""
        self.schedule.fire(self.clock.cycles)

    # --- wires --------------------------------------------------------------------------------------

    def trgo(self, timer: str) -> None:
        """A timer's trigger output rises: it starts conversions and triggers other timers."""
        self.adc.trigger(timer)
        listeners = self._listeners.get(timer)
        if listeners is None:
            listeners = [other for other in self.timers.values() if other.trigger_source() == timer]
            self._listeners[timer] = listeners
        for other in listeners:
            other.trigger()

    def triggers_changed(self) -> None:
        """A timer may listen to another one."""
        self._listeners.clear()

    def dma_request(self, source: str) -> bool:
        """A peripheral asks for a transfer. Returns whether it took place."""
        name, stream, channel = dma_model.REQUESTS[source]
        return self.dmas[name].request(stream, channel)

    def dma_block_ended(self, source: str) -> bool:
        """The last item that the source's stream moved was the last of its block."""
        name, stream, _ = dma_model.REQUESTS[source]
        return self.dmas[name].streams[stream].block_ended

    def on_dma_start(self, source: str, resume: Callable[[], None]) -> None:
        """A source that keeps asking until its stream is enabled."""
        self._dma_resume.append((source, resume))

    def routed(self, signal: str) -> bool:
        """A pin is switched to the signal."""
        known = self._routes.get(signal)
        if known is None:
            known = any(
                self.gpio[port].alternate(pin) == function
                for port, pin, function in PINS[signal]
                if self.wired.get(signal, (port, pin)) == (port, pin)
            )
            self._routes[signal] = known
        return known

    def analog_input(self, channel: int) -> bool:
        """The channel's pin is in analogue mode."""
        port, pin = ANALOG_PINS[channel]
        return self.gpio[port].mode(pin) == ANALOG

    # --- changes that reach beyond a peripheral -----------------------------------------------------

    def gates_changed(self) -> None:
        """A clock was switched on or off."""
        self._clocked.clear()

    def pins_changed(self) -> None:
        """A pin may have got another function."""
        self._routes.clear()

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
        self.clock.deadline = 0

    def _reset(self, cause: str) -> None:
        self._reset_cause = None
        self.resets.append(cause)
        seconds = self.schedule.seconds()
        self.schedule = Schedule(HSI_HZ)
        self.schedule.start(self.clock.cycles, seconds)
        self.clock.watch_priority = NO_WATCH
        left = self.usart2.sent, self.can1.sent  # what is on the wire no reset calls back
        self._build(cause)
        self.usart2.sent, self.can1.sent = left
        self.in_reset = self.stop_at_reset
        self.on_reset()

    # --- running ------------------------------------------------------------------------------------

    def run_until(self, cycle: int) -> None:
        """Runs the chip until (just past) a cycle."""
        clock = self.clock
        while True:
            self.schedule.fire(clock.cycles)
            if self._reset_cause is not None:
                self._reset(self._reset_cause)
            if self.in_reset:
                clock.cycles = max(clock.cycles, cycle)
                self.schedule.fire(clock.cycles)
                return
            if clock.cycles >= cycle:
                return
            self._take_interrupt()
            head = self.schedule.next_cycle()
            deadline = cycle if head is None else min(cycle, head)
            if deadline <= clock.cycles:
                continue
            if self.sleeping or (self.thread_held and not self.nvic.active):
                if self.nvic.pending or self._reset_cause is not None:
                    clock.cycles = deadline
                else:
                    clock.cycles = self.schedule.fire_while_quiet(self._quiet_until(cycle), self.nvic.pending)
                continue
            try:
                stop = self.cpu.run(deadline)
            finally:
                self.flash.settle()
                self.cpu.set_unreadable(self.flash.stale)
            self.schedule.fire(clock.cycles)
            if stop is Stop.EXCEPTION_RETURN:
                self._return()
            elif stop is Stop.SLEEP:
                self.sleeping = not self._wakes()

    def _quiet_until(self, cycle: int) -> int:
        """How far a sleeping chip may be taken in one go: the watchdog's reset ends it."""
        reset = self.iwdg.reset_cycle()
        return cycle if reset is None else max(self.clock.cycles, min(cycle, reset))

    def run_for(self, seconds: float) -> None:
        """Runs the chip for a stretch of time; the processor's clock may change meanwhile."""
        end = self.schedule.seconds() + seconds
        while self.schedule.seconds() < end - 0.5 / self.schedule.frequency:
            self.run_until(
                min(self.schedule.cycle_at(end), self.clock.cycles + int(1e-3 * self.schedule.frequency))
            )

    def _wakes(self) -> bool:
        """WFI ends for an interrupt that would preempt if PRIMASK were clear (PM0214 2.5.3)."""
        candidate = self.nvic.candidate()
        if candidate is None:
            return False
        _, basepri = self.cpu.masks()
        return basepri == 0 or self.nvic.priority_of(candidate) < basepri

    def _take_interrupt(self) -> None:
        """Enters the most urgent pending exception, or leaves word to watch the mask that holds it back."""
        clock, nvic = self.clock, self.nvic
        clock.watch_priority = NO_WATCH
        candidate = None if self.interrupts_held else nvic.candidate()
        if candidate is None:
            return
        primask, basepri = self.cpu.masks()
        priority = nvic.priority_of(candidate)
        if self.sleeping and (basepri == 0 or priority < basepri):
            self.sleeping = False
        if priority >= 0 and (primask or (basepri and priority >= basepri)):
            clock.watch_priority = priority
            return
        nested = nvic.execution_priority() != THREAD
        nvic.enter(candidate)
        if self.on_exception is not None:
            self.on_exception(candidate, True)
        self.cpu.enter(candidate, self._handler(candidate), nested)

    def _handler(self, exception: int) -> int:
        vector = self.scb.value["VTOR"] or FLASH_BASE  # address 0 is an alias of the flash (RM0390 2.4)
        return int.from_bytes(self.memory.read_bytes(vector + 4 * exception, 4), "little")

    def _return(self) -> None:
        """A handler has ended: the next pending one is chained, or the frame is popped."""
        nvic = self.nvic
        finished = nvic.active[-1]
        nvic.leave(finished)
        if self.on_exception is not None:
            self.on_exception(finished, False)
        following = None if self.interrupts_held else nvic.candidate()
        if following is not None:
            primask, basepri = self.cpu.masks()
            priority = nvic.priority_of(following)
            if priority < 0 or not (primask or (basepri and priority >= basepri)):
                nvic.enter(following)
                if self.on_exception is not None:
                    self.on_exception(following, True)
                self.cpu.tail_chain(following, self._handler(following))
                return
        self.cpu.leave()
