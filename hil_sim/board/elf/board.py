"""The shipping binary behind the same protocol as the native core.

The emulated chip is wired as `wiring` says, by default as firmware/boards/nucleo_f446re/README.md does. A
row of `run` is a millisecond of the world: what the converters see at eight instants 125 us apart, and
where the encoders are at the last of them. Where a digital accelerometer is wired, the row holds what lies in
it at the tick, and the converters see mid-scale. Rows are laid on the chip's own trigger grid at its first
conversion; between ticks encoders move linearly, and they rest for 1 us around each tick, so a latch that
is later than that shows in the samples. So do the voltages between conversions: one held more than 1 us
after its trigger is another one.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hil_sim.board.elf.adxl355 import AXES, Adxl355
from hil_sim.board.elf.can_frame import Frame
from hil_sim.board.elf.chip import CData, ffi, lib
from hil_sim.board.elf.errors import EmulatorError
from hil_sim.board.elf.gpio import OUTPUT
from hil_sim.board.elf.image import flash
from hil_sim.board.elf.memory import Memory
from hil_sim.board.elf.signature import VREFINT_CAL
from hil_sim.board.elf.soc import Soc
from hil_sim.board.elf.wire import Wire
from hil_sim.board.elf.wiring import NUCLEO, Wiring
from hil_sim.board.native import TICK_US, BoardConfig

CONVERSIONS = 8  # as world.c has them, with the two periods
MID_SCALE = 2048
TRIGGER_S = 125e-6
TICK_S = 1e-3
BOOT_STEP_S = 50e-6
BOOT_LIMIT_S = 20.0
SERIAL_BAUD = 921600
FRAME_BITS = 10
VREFINT_CHANNEL = 17
SYNC_PULSE_S = 50e-6
ENCODERS = (("TIM2", 0), ("TIM5", 1))
FAULT_ENCODER, FAULT_SYNC, FAULT_LATE, FAULT_STALLED = 1, 2, 4, 8
BUS_OFF_ERRORS = 32  # transmissions that fail with a bit error: 8 each, 256 is bus-off


class ElfBoard:
    """A board with an STM32F446RE in this process, running a binary; implements `Board`.

    After a reset (RESET command, watchdog) the chip waits, `reset_requested` stays true, and `reboot` lets it
    boot again with the memory that it had.

    Args:
        image: the ELF file, or the memory of a chip that has run before (its settings are kept).
        config: of BoardConfig only the unique identity applies; the rest is the binary's own business.
        hse_present: the external clock runs.
        wiring: what is connected to the chip.
    """

    def __init__(
        self,
        image: Path | Memory,
        config: BoardConfig | None = None,
        hse_present: bool = True,
        wiring: Wiring = NUCLEO,
    ) -> None:
        memory = flash(image) if isinstance(image, Path) else image
        uid = (config or BoardConfig()).uid
        self.wiring = wiring
        self.soc = Soc(memory, uid, hse_present, hse_bypass=wiring.hse_bypass)
        self.soc.wired = wiring.signals
        self._world: CData = ffi.new("world *")
        self._world.channels = wiring.axes
        self.soc.chip.world = self._world
        self._adc: NDArray[np.uint16]  # (n, 8, 2), of the rows that run
        self._digital = np.full((1, AXES), 1 << 19, np.uint32)  # the row before, then those that run
        self.sensor: Adxl355 | None = None
        self._encoder: NDArray[np.int64]  # (n + 1, 2), unwrapped: the row before, then those that run
        self._rows: int  # since boot
        self.wire: Wire | None = None
        self.supply_mV = 3300  # of the chip and of what it measures
        self.reference_noise: Callable[[], float] = lambda: 0.0  # codes
        self.soc.stop_at_reset = True
        self.reboot()

    def reboot(self) -> None:
        """Boots the chip, up to just before its first conversion; the world rests meanwhile.

        Raises:
            EmulatorError: the binary starts no conversion.
        """
        self._world.converting = 0
        self._rows = 0
        self._show(np.zeros((0, CONVERSIONS, 2), np.uint16), np.zeros((1, 2), np.int64))
        self._connect()
        self.soc.in_reset = False
        limit = self.soc.schedule.seconds() + BOOT_LIMIT_S
        while (trigger := self.soc.adc.next_trigger()) is None:
            if self.soc.schedule.seconds() > limit:
                raise EmulatorError(f"the binary starts no conversion within {BOOT_LIMIT_S:g} s of its boot")
            self.soc.run_for(BOOT_STEP_S)
        self._first_trigger_s = self.soc.schedule.cycle_seconds(trigger)
        self._world.converting = 1

    # --- the world at the pins ----------------------------------------------------------------------

    def _connect(self) -> None:
        """Wires the world to the chip."""
        self.soc.adc.source = self._analog
        for name, axis in ENCODERS:
            timer = self.soc.timers[name]
            timer.follow_world(axis, partial(self._position, axis, name))
        for port, pin in self.wiring.encoder_faults:
            self.soc.gpio[port].drive(pin, True)
        if self.wire is not None:
            self.wire.connect()
        self.soc.can1.sent.clear()
        if self.wiring.select is not None:
            self._connect_sensor(*self.wiring.select)

    def _connect_sensor(self, port: str, pin: int) -> None:
        """A digital accelerometer keeps its power, and its settings, over a reset of the chip."""
        sensor = self.sensor = self.sensor or Adxl355(self._latest_reading)
        gpio = self.soc.gpio[port]
        gpio.watch(lambda: sensor.select(gpio.mode(pin) == OUTPUT and not gpio.level(pin)))
        self.soc.spi2.exchange = sensor.exchange

    def _latest_reading(self) -> tuple[int, tuple[int, int, int]]:
        """How often SYNC has risen since the triggers began, and what the sensor holds since."""
        rise = self.soc.tim1.rise_s()
        if rise is None or not self._world.converting:
            return 0, (0, 0, 0)
        first_s, period_s = rise
        since_s = self.soc.schedule.seconds() - (self._first_trigger_s - TRIGGER_S) - first_s
        rises = int(since_s // period_s) + 1
        place = min(max(rises - self._world.first_row, 0), len(self._digital) - 1)
        x, y, z = (int(code) for code in self._digital[place])
        return max(rises, 0), (x, y, z)

    def _analog(self, channel: int) -> int:
        """What the world does not put on a channel itself."""
        if channel == VREFINT_CHANNEL:
            return round(VREFINT_CAL * 3300 / self.supply_mV + self.reference_noise())
        if self.wire is not None and (code := self.wire.code(channel)) is not None:
            return code
        if channel not in self.wiring.axes:
            raise EmulatorError(f"nothing is wired to ADC channel {channel}")
        raise EmulatorError(f"the pin of ADC channel {channel} is not in analogue mode")

    @property
    def _first_trigger_s(self) -> float:
        """Of row 0."""
        return float(self._world.first_trigger_s)

    @_first_trigger_s.setter
    def _first_trigger_s(self, seconds: float) -> None:
        self._world.first_trigger_s = seconds

    def _show(self, adc: NDArray[np.uint16], encoder: NDArray[np.int64]) -> None:
        """Rows of the world, from the next one on; encoder has the row before them too."""
        self._adc, self._encoder = np.ascontiguousarray(adc), np.ascontiguousarray(encoder)
        self._world.codes = ffi.cast("uint16_t *", self._adc.ctypes.data)
        self._world.counts = ffi.cast("int64_t *", self._encoder.ctypes.data)
        self._world.rows, self._world.first_row = len(adc), self._rows

    def _position(self, axis: int, timer: str) -> int:
        """Counts of an encoder now; 0 while the chip boots, which is where its counters start."""
        routed = self.soc.routed
        if not (self._world.converting and routed(timer + "_CH1") and routed(timer + "_CH2")):
            return 0
        return int(lib.world_position(self._world, self.soc.schedule.seconds(), axis))

    # --- Board --------------------------------------------------------------------------------------

    @property
    def now_us(self) -> int:
        """The board's clock, microseconds since its boot (its first trigger is at 125)."""
        return int((self.soc.schedule.seconds() - self._first_trigger_s + TRIGGER_S) * 1e6)

    @property
    def next_tick_us(self) -> int:
        """Board time of the next tick that `run` will run."""
        return TICK_US * (self._rows + 1)

    @property
    def streaming(self) -> None:
        """The chip does not show it."""

    @property
    def self_test_pin(self) -> bool:
        """The accelerometer's self-test input is driven."""
        if self.sensor is not None:
            return self.sensor.self_test
        port, pin = self.wiring.self_test
        return self.soc.gpio[port].level(pin)

    @property
    def reset_requested(self) -> bool:
        """The chip is in reset until `reboot`."""
        return self.soc.in_reset

    def run(
        self,
        adc: NDArray[np.uint16] | NDArray[np.uint32],
        encoder: NDArray[np.int32],
        faults: NDArray[np.uint8] | None = None,
    ) -> None:
        """Runs one tick per row, to just before the next tick's first conversion.

        adc: (n, 8, 2) codes, of a digital sensor (n, 1, 3); encoder: (n, 2) counts; faults: (n,) bits as in
        impid_board.h.
        """
        if self.sensor is not None:
            rows = np.asarray(adc, np.uint32).reshape(-1, AXES)
            self._digital = np.concatenate([self._digital[-1:], rows])
            adc = np.full((len(rows), CONVERSIONS, 2), MID_SCALE, np.uint16)
        counts = np.asarray(encoder).astype(np.int64)
        steps = np.diff(counts, axis=0, prepend=self._encoder[-1:]).astype(
            np.int32
        )  # wraps with the counters
        moved = np.vstack([np.zeros((1, 2), np.int64), np.cumsum(steps.astype(np.int64), axis=0)])
        first = self._rows
        self._show(np.asarray(adc, np.uint16), self._encoder[-1] + moved)
        if faults is not None and np.any(faults):
            for row, bits in enumerate(faults):
                self._rows = first + row
                self._inject(int(bits))
                self._run_to_row(self._rows + 1)
        self._run_to_row(first + len(counts))

    def _row_end_s(self, row: int) -> float:
        """When a row's last conversion, plus nearly one trigger period, is over."""
        return self._first_trigger_s + row * TICK_S - 0.02 * TRIGGER_S

    def _run_to_row(self, row: int) -> None:
        self.soc.run_for(self._row_end_s(row) - self.soc.schedule.seconds())
        self._rows = row

    def _inject(self, bits: int) -> None:
        soc = self.soc
        port, pin = self.wiring.encoder_faults[0]
        soc.gpio[port].drive(pin, not bits & FAULT_ENCODER)
        soc.thread_held = bool(bits & FAULT_STALLED)
        if bits & FAULT_SYNC and soc.routed("TIM4_CH1"):
            timer = soc.timers["TIM4"]
            soc.schedule.after_seconds(TICK_S / 2, lambda: timer.pulse(1, SYNC_PULSE_S))
        if bits & FAULT_LATE:
            soc.interrupts_held = True
            soc.schedule.after_seconds(2.2 * TICK_S, self._release_interrupts)

    def _release_interrupts(self) -> None:
        self.soc.interrupts_held = False
        self.soc.interrupts_changed()

    @property
    def lines_idle_us(self) -> int:
        """The USART and the controller are as far as the chip's time."""
        return self.now_us

    def advance(self, t_us: int) -> None:
        """The chip runs whole ticks only."""

    def serial_receive(self, data: bytes, t_us: int) -> None:
        """Bytes whose last one arrives at board time t_us, or as soon as the line can carry them."""
        begin = self._first_trigger_s - TRIGGER_S + t_us * 1e-6 - len(data) * FRAME_BITS / SERIAL_BAUD
        delay = begin - self.soc.schedule.seconds()
        usart = self.soc.usart2
        if delay > 0:
            self.soc.schedule.after_seconds(delay, lambda: usart.receive(data, SERIAL_BAUD))
        else:
            usart.receive(data, SERIAL_BAUD)

    def serial_take(self) -> bytes:
        """Bytes that the board has sent since the last call."""
        taken = bytes(self.soc.usart2.sent)
        self.soc.usart2.sent.clear()
        return taken

    def can_receive(self, identifier: int, data: bytes, t_us: int) -> None:
        """A classic frame that another node begins to send at board time t_us."""
        delay = self._first_trigger_s - TRIGGER_S + t_us * 1e-6 - self.soc.schedule.seconds()
        can = self.soc.can1
        if delay > 0:
            self.soc.schedule.after_seconds(delay, lambda: can.receive(identifier, data))
        else:
            can.receive(identifier, data)

    def can_take(self) -> list[tuple[int, bytes]]:
        """Identifier and data of the frames that the board has sent since the last call."""
        taken: list[Frame] = list(self.soc.can1.sent)
        self.soc.can1.sent.clear()
        return [(frame.identifier, frame.data) for frame in taken]

    def can_bus_off(self) -> None:
        """Another node destroys the next transmissions until the controller leaves the bus."""
        self.soc.can1.damaged_transmissions = BUS_OFF_ERRORS

    def close(self) -> None:
        """Nothing is held."""
