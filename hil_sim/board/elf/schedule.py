"""Simulated time in cycles of the processor's clock, and what is to happen when (schedule.c).

Cycles are the base because everything on the buses counts them exactly. What follows another clock (the
low-speed oscillator, the analogue world, a wire) converts with `seconds` and `cycles_for`; a change of the
processor's clock starts a new line of that conversion.
"""

from collections.abc import Callable
from itertools import count

from hil_sim.board.elf.chip import CData, lib

Action = Callable[[], None]


class Event:
    """Something that happens at a cycle unless it is cancelled."""

    __slots__ = ("action", "number", "pointer", "schedule")

    def __init__(self, schedule: "Schedule", number: int, action: Action) -> None:
        self.schedule = schedule
        self.number = number
        self.action = action
        self.pointer: CData = None  # of the C event, until it has happened or been cancelled

    @property
    def cycle(self) -> int:
        """When it is to happen."""
        return int(self.pointer.cycle)

    def cancel(self) -> None:
        """It will not happen."""
        if self.pointer is not None:
            lib.schedule_cancel(self.pointer)
            self.schedule.forget(self)


class Schedule:
    """Events in order of time; those of one cycle in the order in which they were asked for."""

    def __init__(self, chip: CData) -> None:
        self._chip = chip
        self._numbers = count()
        self._waiting: dict[int, Event] = {}

    @property
    def now(self) -> int:
        """The cycle up to which everything has happened."""
        return int(self._chip.now)

    @property
    def frequency(self) -> float:
        """Of the processor's clock, Hz."""
        return float(self._chip.frequency)

    def start(self, cycle: int, seconds: float, frequency: float) -> None:
        """Begins anew, with nothing to happen: the chip was reset, the world goes on."""
        for event in list(self._waiting.values()):
            self.forget(event)
        lib.schedule_start(self._chip, cycle, seconds, frequency)

    def forget(self, event: Event) -> None:
        """The event is over."""
        event.pointer = None
        self._waiting.pop(event.number, None)

    def _new(self, action: Action) -> Event:
        event = Event(self, next(self._numbers), action)
        self._waiting[event.number] = event
        return event

    def happens(self, number: int) -> None:
        """An event's time has come."""
        event = self._waiting[number]
        self.forget(event)
        event.action()

    def at(self, cycle: int, action: Action) -> Event:
        """Calls action at a cycle (at once when that is past, but never before older events)."""
        event = self._new(action)
        event.pointer = lib.schedule_python(self._chip, cycle, event.number)
        return event

    def after(self, cycles: int, action: Action) -> Event:
        """Calls action so many cycles from now."""
        return self.at(self.now + cycles, action)

    def after_seconds(self, delay: float, action: Action) -> Event:
        """Calls action after a stretch of time, whatever becomes of the processor's clock meanwhile."""
        event = self._new(action)
        event.pointer = lib.schedule_python_after_seconds(self._chip, delay, event.number)
        return event

    def fire(self, until: int) -> None:
        """Lets everything happen that is due at or before a cycle; `now` ends there."""
        lib.schedule_fire(self._chip, until)

    def seconds(self) -> float:
        """Time since power-on, in seconds."""
        return float(lib.schedule_seconds(self._chip))

    def cycle_seconds(self, cycle: int) -> float:
        """Time since power-on of a cycle, if the clock keeps its frequency."""
        return float(self._chip.base_seconds) + (cycle - int(self._chip.base_cycle)) / self.frequency

    def cycle_at(self, seconds: float) -> int:
        """The cycle at a time since power-on, if the clock keeps its frequency."""
        return int(self._chip.base_cycle) + round((seconds - float(self._chip.base_seconds)) * self.frequency)

    def cycles_for(self, seconds: float) -> int:
        """Cycles in a stretch of time, at least one."""
        return max(1, round(seconds * self.frequency))

    def set_frequency(self, frequency: float) -> None:
        """The processor's clock changes now."""
        lib.schedule_set_frequency(self._chip, frequency)
