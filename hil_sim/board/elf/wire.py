"""A jumper wire from the sampling timer's own output to another pin, and encoder lines that nothing but that
wire and the chip's pull resistors holds: what the bench test of docs/hardware.md works with.
"""

from typing import TYPE_CHECKING

from hil_sim.board.elf.chip import lib
from hil_sim.board.elf.soc import ANALOG_PINS, PINS

if TYPE_CHECKING:
    from hil_sim.board.elf.board import ElfBoard
    from hil_sim.board.elf.wiring import Pin

FULL_SCALE = 4095
# Places around the circle of (line A, line B): forwards A leads.
AROUND = {(False, False): 0, (True, False): 1, (True, True): 2, (False, True): 3}


class Wire:
    """Put on a board it stays; `end` says where the loose end is, None: nowhere."""

    def __init__(self, board: "ElfBoard") -> None:
        self._board = board
        self._channels = tuple(board.wiring.axes)
        self.end: Pin | None = None
        self._places = [0, 0]
        self._positions = [0, 0]
        board.wire = self
        self.connect()

    def connect(self) -> None:
        """Takes the encoders' place on a chip that has just come out of reset."""
        self._places, self._positions = [0, 0], [0, 0]
        for axis, timer in enumerate(("TIM2", "TIM5")):
            self._board.soc.timers[timer].position = lambda axis=axis, timer=timer: self._count(axis, timer)

    def put(self, end: "Pin | None") -> None:
        """Moves the loose end."""
        self.end = end
        world = self._board.soc.chip.world
        world.channels = [-1 if ANALOG_PINS[c] == end else c for c in self._channels]

    def code(self, channel: int) -> int | None:
        """What a channel reads over the wire; None where the wire is not."""
        if ANALOG_PINS.get(channel) != self.end:
            return None
        soc = self._board.soc
        held = soc.schedule.seconds() + lib.adc_held_after_s(soc.adc.shared, channel)
        return FULL_SCALE if self._source(soc.schedule.cycle_at(held)) else 0

    def _source(self, cycle: int) -> bool:
        soc = self._board.soc
        return soc.routed("TIM3_CH1") and soc.timers["TIM3"].output.level(cycle)

    def _line(self, signal: str) -> bool:
        soc = self._board.soc
        pin = soc.wired.get(signal, PINS[signal][0][:2])
        if self.end == pin:
            return self._source(soc.schedule.now)
        return soc.gpio[pin[0]].level(pin[1])

    def _count(self, axis: int, timer: str) -> int:
        place = AROUND[self._line(f"{timer}_CH1"), self._line(f"{timer}_CH2")]
        step = (place - self._places[axis]) % 4
        self._positions[axis] += {0: 0, 1: 1, 3: -1}.get(step, 0)  # two lines at once: no direction
        self._places[axis] = place
        return self._positions[axis]
