"""From a fault of the schedule to what begins it, ends it, and counts what it did."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from hil_sim.carriers.protocol import Cable
from hil_sim.errors import SimError
from hil_sim.faults import damage, schema
from hil_sim.faults.bus import FaultyBus, FrameDamage
from hil_sim.faults.line import FaultyLine
from hil_sim.faults.readings import FaultyReadings

Counts = dict[str, int]
BOOT_US = 5000  # from the end of a reset to the first sample


class PowerSwitch(Protocol):
    """The board's reset input and supply, and its bus."""

    def restart(self, reset_cause: str, off_us: int) -> None:
        """The board stops now and boots off_us later; reset_cause as in the message set."""

    def short_bus(self) -> None:
        """The CAN controller leaves the bus, again and again."""

    def free_bus(self) -> None:
        """It stays on the bus."""


class RobotLog(Protocol):
    """The robot's own log."""

    def truncate(self, at_s: float) -> int:
        """The log ends within the row before at_s (since its first row); how many whole rows it has."""


@dataclass(frozen=True)
class Rig:
    """Where faults take hold.

    Attributes:
        cable: what `cable_pulled` pulls.
        line: the serial line, or the one behind the CAN adapter; None without one.
        bus: None without one.
        readings: what the board reads.
        power: the board.
        log: None if none is written.
    """

    cable: Cable
    line: FaultyLine | None
    bus: FaultyBus | None
    readings: FaultyReadings
    power: PowerSwitch
    log: RobotLog | None


class Injector:
    """One fault; by itself it does nothing."""

    def begin(self) -> None:
        """The fault begins."""

    def end(self) -> None:
        """It is over."""

    def counts(self) -> Counts:
        """What it has done so far; names are those of the truth file."""
        return {}


_LINE_DAMAGE: dict[type, tuple[Callable[[float, np.random.Generator], damage.Damage], str]] = {
    schema.BitErrors: (damage.FlippedBits, "bits"),
    schema.DroppedBytes: (damage.DroppedBytes, "bytes"),
    schema.DuplicatedBytes: (damage.DuplicatedBytes, "bytes"),
}


class _LineDamage(Injector):
    def __init__(
        self,
        fault: schema.BitErrors | schema.DroppedBytes | schema.DuplicatedBytes,
        rig: Rig,
        generator: np.random.Generator,
    ) -> None:
        assert rig.line is not None
        make, self._unit = _LINE_DAMAGE[type(fault)]
        self._damage = make(fault.rate, generator)
        self._where = rig.line.to_host if fault.direction == "to_host" else rig.line.to_board

    def begin(self) -> None:
        self._where.append(self._damage)

    def end(self) -> None:
        self._where.remove(self._damage)

    def counts(self) -> Counts:
        return {self._unit: self._damage.count}


class _FrameDamage(Injector):
    def __init__(
        self,
        fault: schema.DroppedFrames | schema.DuplicatedFrames,
        rig: Rig,
        generator: np.random.Generator,
    ) -> None:
        assert rig.bus is not None
        self._damage = FrameDamage(0 if isinstance(fault, schema.DroppedFrames) else 2, fault.rate, generator)
        self._where = rig.bus.filters

    def begin(self) -> None:
        self._where.append(self._damage)

    def end(self) -> None:
        self._where.remove(self._damage)

    def counts(self) -> Counts:
        return {"frames": self._damage.count}


class _LineStall(Injector):
    def __init__(self, _fault: schema.LineStall, rig: Rig, _: np.random.Generator) -> None:
        self._where = _client_side(rig)
        self._unit = "bytes" if isinstance(self._where, FaultyLine) else "frames"
        self._held = 0

    def begin(self) -> None:
        self._where.stall()

    def end(self) -> None:
        self._held = self._where.resume()

    def counts(self) -> Counts:
        return {f"delayed_{self._unit}": self._held}


class _SlowReader(Injector):
    def __init__(self, fault: schema.SlowReader, rig: Rig, _: np.random.Generator) -> None:
        self._fault = fault
        self._where = _client_side(rig)
        self._unit = "bytes" if isinstance(self._where, FaultyLine) else "frames"
        self._lost = 0

    def begin(self) -> None:
        self._where.throttle(self._fault.bytes_per_s, self._fault.buffer_bytes)

    def end(self) -> None:
        self._lost = self._where.unthrottle()

    def counts(self) -> Counts:
        return {f"lost_{self._unit}": self._lost}


class _CablePulled(Injector):
    def __init__(self, _fault: schema.CablePulled, rig: Rig, _: np.random.Generator) -> None:
        self._cable = rig.cable

    def begin(self) -> None:
        self._cable.pull()

    def end(self) -> None:
        self._cable.plug()


class _MainLoopStall(Injector):
    def __init__(self, _fault: schema.MainLoopStall, rig: Rig, _: np.random.Generator) -> None:
        self._readings = rig.readings

    def begin(self) -> None:
        self._readings.hanging = True

    def end(self) -> None:
        self._readings.hanging = False


class _Watchdog(_MainLoopStall):
    def __init__(self, fault: schema.Watchdog, rig: Rig, generator: np.random.Generator) -> None:
        super().__init__(
            schema.MainLoopStall(**fault.model_dump() | {"kind": "main_loop_stall"}), rig, generator
        )
        self._power = rig.power

    def end(self) -> None:
        super().end()
        self._power.restart("WATCHDOG", BOOT_US)


class _BoardReset(Injector):
    def __init__(self, _fault: schema.BoardReset, rig: Rig, _: np.random.Generator) -> None:
        self._power = rig.power

    def begin(self) -> None:
        self._power.restart("PIN", BOOT_US)


class _BrownOut(Injector):
    def __init__(self, fault: schema.BrownOut, rig: Rig, _: np.random.Generator) -> None:
        self._off_us = fault.end_us - fault.begin_us
        self._power = rig.power

    def begin(self) -> None:
        self._power.restart("BROWN_OUT", self._off_us + BOOT_US)


class _BusOff(Injector):
    def __init__(self, _fault: schema.BusOff, rig: Rig, _: np.random.Generator) -> None:
        assert rig.bus is not None
        self._bus, self._power = rig.bus, rig.power
        self._swallowed = 0

    def begin(self) -> None:
        self._bus.short()
        self._power.short_bus()

    def end(self) -> None:
        self._swallowed = self._bus.unshort()
        self._power.free_bus()

    def counts(self) -> Counts:
        return {"lost_frames": self._swallowed}


class _AdcSaturation(Injector):
    def __init__(self, fault: schema.AdcSaturation, rig: Rig, _: np.random.Generator) -> None:
        self._fault, self._readings = fault, rig.readings

    def begin(self) -> None:
        self._readings.saturate(self._fault.axis, self._fault.rail)

    def end(self) -> None:
        self._readings.release(self._fault.axis)


class _EncoderLost(Injector):
    def __init__(self, fault: schema.EncoderLost, rig: Rig, _: np.random.Generator) -> None:
        self._fault, self._readings = fault, rig.readings
        self._missed = 0

    def begin(self) -> None:
        self._readings.break_line(self._fault.encoder, reported=self._fault.reported)

    def end(self) -> None:
        self._missed = self._readings.mend_line(self._fault.encoder)

    def counts(self) -> Counts:
        return {"missed_counts": self._missed}


class _TorqueLogTruncated(Injector):
    def __init__(self, fault: schema.TorqueLogTruncated, rig: Rig, _: np.random.Generator) -> None:
        assert rig.log is not None
        self._at_s, self._log = fault.at_s, rig.log
        self._rows = 0

    def begin(self) -> None:
        self._rows = self._log.truncate(self._at_s)

    def counts(self) -> Counts:
        return {"whole_rows": self._rows}


_INJECTORS: dict[type, Any] = {
    schema.BitErrors: _LineDamage,
    schema.DroppedBytes: _LineDamage,
    schema.DuplicatedBytes: _LineDamage,
    schema.DroppedFrames: _FrameDamage,
    schema.DuplicatedFrames: _FrameDamage,
    schema.LineStall: _LineStall,
    schema.SlowReader: _SlowReader,
    schema.CablePulled: _CablePulled,
    schema.MainLoopStall: _MainLoopStall,
    schema.BoardReset: _BoardReset,
    schema.BrownOut: _BrownOut,
    schema.Watchdog: _Watchdog,
    schema.BusOff: _BusOff,
    schema.AdcSaturation: _AdcSaturation,
    schema.EncoderLost: _EncoderLost,
    schema.TorqueLogTruncated: _TorqueLogTruncated,
}


def injector(fault: schema.Fault, rig: Rig, generator: np.random.Generator) -> Injector:
    """What carries this fault out on this rig.

    Raises:
        SimError: the rig has nothing on which it could act.
    """
    kind = fault.kind
    if isinstance(fault, schema.SERIAL_ONLY) and rig.line is None:
        raise SimError(f"fault {kind}: there is no serial line; use --carrier pty, tcp or slcan")
    if isinstance(fault, schema.CAN_ONLY) and rig.bus is None:
        raise SimError(f"fault {kind}: there is no bus; use --carrier slcan, udp_multicast or socketcan")
    if isinstance(fault, schema.TorqueLogTruncated) and rig.log is None:
        raise SimError(f"fault {kind}: no log is written; name one with --robot-log")
    made: Injector = _INJECTORS[type(fault)](fault, rig, generator)
    return made


def _client_side(rig: Rig) -> FaultyLine | FaultyBus:
    """Where the client's own machine reads: the adapter's line if it has one, otherwise the bus."""
    where = rig.line or rig.bus
    assert where is not None
    return where
