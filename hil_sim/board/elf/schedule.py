"""Simulated time in cycles of the processor's clock, and what is to happen when.

Cycles are the base because everything on the buses counts them exactly. What follows another clock (the
low-speed oscillator, the analogue world, a wire) converts with `seconds` and `cycles_for`; a change of the
processor's clock starts a new line of that conversion.
"""

import heapq
from collections.abc import Callable
from itertools import count

Action = Callable[[], None]


class Event:
    """Something that happens at a cycle unless it is cancelled."""

    __slots__ = ("action", "cycle", "seconds")

    def __init__(self, cycle: int, action: Action, seconds: float | None = None) -> None:
        self.cycle = cycle
        self.seconds = seconds  # set if the event follows time rather than the processor's clock
        self.action: Action | None = action

    def cancel(self) -> None:
        """It will not happen."""
        self.action = None


class Schedule:
    """Events in order of time; those of one cycle in the order in which they were asked for."""

    def __init__(self, frequency: float) -> None:
        self.now = 0
        self.frequency = frequency
        self._base_cycle = 0
        self._base_seconds = 0.0
        self._heap: list[tuple[int, int, Event]] = []
        self._order = count()

    def start(self, cycle: int, seconds: float) -> None:
        """Begins at a cycle and a time other than zero: the chip was reset, the world goes on."""
        self.now = self._base_cycle = cycle
        self._base_seconds = seconds

    def at(self, cycle: int, action: Action) -> Event:
        """Calls action at a cycle (at once when that is past, but never before older events)."""
        event = Event(cycle, action)
        heapq.heappush(self._heap, (cycle, next(self._order), event))
        return event

    def after(self, cycles: int, action: Action) -> Event:
        """Calls action so many cycles from now."""
        return self.at(self.now + cycles, action)

    def after_seconds(self, delay: float, action: Action) -> Event:
        """Calls action after a stretch of time, whatever becomes of the processor's clock meanwhile."""
        seconds = self.seconds() + delay
        event = Event(self.now + self.cycles_for(delay), action, seconds)
        heapq.heappush(self._heap, (event.cycle, next(self._order), event))
        return event

    def next_cycle(self) -> int | None:
        """When the next event happens."""
        while self._heap and self._heap[0][2].action is None:
            heapq.heappop(self._heap)
        return self._heap[0][0] if self._heap else None

    def fire(self, until: int) -> None:
        """Lets everything happen that is due at or before a cycle; `now` ends there."""
        heap = self._heap
        while heap and heap[0][0] <= until:
            cycle, _, event = heapq.heappop(heap)
            if event.action is not None:
                self.now = max(self.now, cycle)
                event.action()
        self.now = max(self.now, until)

    def fire_while_quiet(self, until: int, pending: set[int]) -> int:
        """As `fire`, but ends after the event that makes something pending. Returns the cycle reached."""
        heap = self._heap
        while not pending and heap and heap[0][0] <= until:
            cycle, _, event = heapq.heappop(heap)
            if event.action is not None:
                self.now = cycle
                event.action()
        self.now = until if not pending else self.now
        return self.now

    def seconds(self) -> float:
        """Time since power-on, in seconds."""
        return self._base_seconds + (self.now - self._base_cycle) / self.frequency

    def cycle_seconds(self, cycle: int) -> float:
        """Time since power-on of a cycle, if the clock keeps its frequency."""
        return self._base_seconds + (cycle - self._base_cycle) / self.frequency

    def cycle_at(self, seconds: float) -> int:
        """The cycle at a time since power-on, if the clock keeps its frequency."""
        return self._base_cycle + round((seconds - self._base_seconds) * self.frequency)

    def cycles_for(self, seconds: float) -> int:
        """Cycles in a stretch of time, at least one."""
        return max(1, round(seconds * self.frequency))

    def set_frequency(self, frequency: float) -> None:
        """The processor's clock changes now."""
        self._base_seconds = self.seconds()
        self._base_cycle = self.now
        self.frequency = frequency
        waiting, self._heap[:] = self._heap[:], []
        for cycle, order, event in waiting:
            if event.seconds is not None:
                event.cycle = max(self.now, self.cycle_at(event.seconds))
            heapq.heappush(self._heap, (cycle if event.seconds is None else event.cycle, order, event))
