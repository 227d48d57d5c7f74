"""The board, its supply and its reset: one boot after another on one wall clock."""

from dataclasses import dataclass, replace

from hil_sim.board import layout
from hil_sim.board.make import BoardMaker
from hil_sim.board.native import TICK_US, BoardConfig, unpowered_memory

# From bus-off to bus-off while the bus is shorted: 128 times 11 bits of waiting, then 32 attempts.
BUS_OFF_AGAIN_US = 3000
LOSSES_OF_POWER = frozenset({"POWER_ON", "BROWN_OUT"})


@dataclass(frozen=True)
class Boot:
    """One boot of the board.

    Attributes:
        boot_id: its number.
        reset_cause: as in the message set.
        shift_us: this board's clock shows so much more than that of the boot before would.
    """

    boot_id: int
    reset_cause: str
    shift_us: int


class PoweredBoard:
    """Implements `PowerSwitch`; `board` is the one that runs now."""

    def __init__(self, config: BoardConfig, make: BoardMaker) -> None:
        self._config, self._make = config, make
        self.board = make(config)
        self.at_us = self.board.now_us  # what the clock shows at the moment in question
        self._new_boot: Boot | None = None
        self._next_bus_off_us: int | None = None

    @property
    def boot_id(self) -> int:
        """Of the board that runs."""
        return self._config.boot_id

    def restart(self, reset_cause: str, off_us: int) -> None:
        """The board stops at `at_us` and boots off_us later, its clock at zero."""
        self.board.close()
        if reset_cause in LOSSES_OF_POWER:
            self._config.retained[:] = unpowered_memory()
        cause = layout.code("STATUS_HEALTH", "reset_cause", reset_cause)
        self._config = replace(self._config, boot_id=self._config.boot_id + 1, reset_cause=cause, start_us=0)
        self.board = self._make(self._config)
        self._new_boot = Boot(self._config.boot_id, reset_cause, -off_us - self.at_us)
        if self._next_bus_off_us is not None:
            self._next_bus_off_us = 0

    def take_new_boot(self) -> Boot | None:
        """The boot since the last call, if there was one."""
        boot, self._new_boot = self._new_boot, None
        return boot

    def short_bus(self) -> None:
        """From now on the controller leaves the bus whenever it has come back."""
        self._next_bus_off_us = self.at_us

    def free_bus(self) -> None:
        """It stays on the bus."""
        self._next_bus_off_us = None

    def before_ticks(self, ticks: int) -> int:
        """Lets the controller leave the bus if it is time; how many of the next ticks may run at once."""
        if self._next_bus_off_us is None:
            return ticks
        next_tick_us = self.board.next_tick_us
        if next_tick_us >= self._next_bus_off_us:
            self.board.can_bus_off()
            self._next_bus_off_us = next_tick_us + BUS_OFF_AGAIN_US
        return min(ticks, -((next_tick_us - self._next_bus_off_us) // TICK_US))
