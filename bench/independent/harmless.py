"""Noise, quantisation and logging that are unusual and hide nothing: the right answer to them is "nothing is missing".

Each kind turns a drawn laboratory's instruments into its own (``instruments``) and may go over the rows of each
trial as a logger would (``rows``). What it changes in a value is noise like any other and stands in the truth's
floors. The rows stay within the study format: missing and late samples, steps, any rate, clocks of any age.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.random import Generator

from .instruments import Record
from .laboratory import Instruments, Noise
from .mechanics import Array

VALUES = ("tau1", "tau2", "fx", "fy")


def _same(record: Record, rng: Generator) -> Record:
    return record


@dataclass(frozen=True)
class Kind:
    """``noise`` is a kind of ``noise.FRESH`` for the channels named, ``sets`` are instruments' fields."""

    words: str
    noise: str | None = None
    channels: tuple[str, ...] = ("torque", "accel", "sensor")
    sets: Callable[[Generator], dict[str, Any]] = lambda rng: {}
    rows: Callable[[Record, Generator], Record] = _same

    def instruments(self, ins: Instruments, rng: Generator) -> Instruments:
        if self.noise:
            heard: dict[str, Any] = {c: Noise(self.noise, getattr(ins, c).level) for c in self.channels}
            ins = replace(ins, **heard)
        return replace(ins, **self.sets(rng))


def _rewritten(record: Record, change: Callable[[Array], Array]) -> Record:
    """Torques and forces as another number format keeps them, with the error among the noise."""
    new = {c: change(record.robot[c]) if c in VALUES else v for c, v in record.robot.items()}
    off = [new[c] - record.robot[c] if c in new else np.zeros_like(new["t"]) for c in VALUES]
    return replace(
        record,
        robot=new,
        torque_noise=record.torque_noise + np.column_stack(off[:2]),
        force_noise=record.force_noise + np.column_stack(off[2:]),
    )


def _half_floats(record: Record, rng: Generator) -> Record:
    return _rewritten(record, lambda v: v.astype(np.float16).astype(float))


def _three_digits(record: Record, rng: Generator) -> Record:
    def rounded(v: Array) -> Array:
        size = 10.0 ** (np.floor(np.log10(np.maximum(np.abs(v), 1e-9))) - 2)
        return np.round(v / size) * size

    return _rewritten(record, rounded)


def _robot_rows(record: Record, keep: Array) -> Record:
    return replace(
        record,
        robot={c: v[keep] for c, v in record.robot.items()},
        robot_t=record.robot_t[keep],
        torque_noise=record.torque_noise[keep],
        force_noise=record.force_noise[keep],
    )


def _module_rows(record: Record, keep: Array) -> Record:
    return replace(
        record,
        device={c: v[keep] for c, v in record.device.items()},
        module_t=record.module_t[keep],
        accel_noise=record.accel_noise[keep],
    )


def _runs(n: int, longest: int, rng: Generator) -> Array:
    """Rows that are left when a few runs of up to ``longest`` rows are lost; the first and the last stay."""
    keep = np.ones(n, dtype=bool)
    for _ in range(int(rng.integers(3, 9))):
        first = int(rng.integers(1, max(2, n - longest - 1)))
        keep[first : first + int(rng.integers(2, longest + 1))] = False
    keep[[0, -1]] = True
    return keep


def _burst_losses(record: Record, rng: Generator) -> Record:
    """Up to 40 ms at a time, in either log."""
    lasts = record.robot_t[-1] - record.robot_t[0]
    rates = [t.size / lasts for t in (record.robot_t, record.module_t)]
    robot, module = (max(2, int(0.04 * rate)) for rate in rates)
    record = _robot_rows(record, _runs(record.robot_t.size, robot, rng))
    return _module_rows(record, _runs(record.module_t.size, module, rng))


def _late_start(record: Record, rng: Generator) -> Record:
    """The robot's log begins up to 1.5 s after the module's and ends up to 1 s before it."""
    t = record.robot_t
    inside = (t > t[0] + rng.uniform(0.3, 1.5)) & (t < t[-1] - rng.uniform(0.1, 1))
    return _robot_rows(record, inside)


def _on_change(record: Record, rng: Generator) -> Record:
    """A row is written when the first torque has moved by two noises, or after eight periods."""
    tau, last, kept = record.robot["tau1"], 0, [0]
    step = 2 * float(record.torque_noise[:, 0].std())
    for i, value in enumerate(tau.tolist()):
        if i and (abs(value - tau[last]) > step or i - last >= 8):
            kept.append(i)
            last = i
    keep = np.zeros(tau.size, dtype=bool)
    keep[kept] = True
    keep[-1] = True
    return _robot_rows(record, keep)


def _stamps(record: Record, rng: Generator) -> Record:
    """Times of the robot's rows rounded to a millisecond, of a rate that is no whole number of them."""
    return replace(record, robot={**record.robot, "t": np.round(record.robot["t"], 3)})


def _long_uptime(record: Record, rng: Generator) -> Record:
    """The module has been on for weeks: sample numbers wrap within the study, times need more than 32 bits."""
    device = dict(record.device)
    device["t_us"] = device["t_us"] + 3_888_000_000_000.0
    device["seq"] = np.mod(device["seq"] + 4294967296 - 35_000, 4294967296)
    return replace(record, device=device)


def _low_bits(record: Record, rng: Generator) -> Record:
    """The converter's low bits are dead; codes come in steps of 16 about the true value."""
    if "ax" not in record.device:
        return record
    device, step = dict(record.device), 16.0
    for axis in ("ax", "ay"):
        device[axis] = np.clip(np.round(device[axis] / step) * step, 0, None)
    return replace(record, device=device)


def _steps(rng: Generator) -> dict[str, Any]:
    return {"torque_step": float(rng.uniform(6, 12)), "force_step": float(rng.uniform(6, 12))}


HARMLESS: dict[str, Kind] = {
    "mains_hum": Kind("mains hum and its third harmonic, six times the noise, in all channels", "hum"),
    "common_supply": Kind("both axes of each instrument hear the same noise", "common"),
    "sparkles": Kind("one row in some thousands is off by tens of noises", "sparkles"),
    "stable_tails": Kind("noise with the tails of a stable law", "stable", ("torque", "sensor")),
    "sweeping_tone": Kind("a tone that wanders between 14 and 40 Hz", "sweeping"),
    "interleaved": Kind("two converters take turns and differ, in every second row", "interleaved"),
    "compressor": Kind("a compressor comes on and doubles the noise for a third of the time", "compressor"),
    "long_memory": Kind("noise whose spectrum rises as f^-0.6 as low as can be seen", "long_memory"),
    "averaged": Kind("noise averaged over overlapping windows of 30 ms", "averaged", ("torque", "sensor")),
    "held": Kind("a slow converter's noise, held for some tens of ms", "held", ("torque", "sensor")),
    "dying": Kind("noise that dies away from three times to its own size within a trial", "dying"),
    "raindrops": Kind("one-sided pulses that fade within some ms, less their mean", "raindrops"),
    "two_codes": Kind("a reading that toggles between two values", "two_codes", ("torque", "sensor")),
    "half_floats": Kind("torques and forces kept as 16-bit floats", rows=_half_floats),
    "three_digits": Kind("torques and forces printed with three digits", rows=_three_digits),
    "coarse_steps": Kind("torques and forces in steps of six to twelve noises", sets=_steps),
    "burst_losses": Kind("rows are lost by runs of up to 40 ms", rows=_burst_losses),
    "late_start": Kind("the robot's log begins later and ends earlier", rows=_late_start),
    "on_change": Kind("a row is written when the torque has changed", rows=_on_change),
    "rounded_stamps": Kind(
        "the robot's times are rounded to a millisecond",
        sets=lambda rng: {"robot_rate": float(rng.choice([128.0, 240.0, 300.0, 333.0])), "jitter": 0.0},
        rows=_stamps,
    ),
    "long_uptime": Kind("the module has been on for weeks", rows=_long_uptime),
    "low_bits": Kind(
        "the accelerometer's converter has dead low bits",
        sets=lambda rng: {"full_scale_code": 65536, "ready_made": False},
        rows=_low_bits,
    ),
    "slow_log": Kind(
        "the robot logs 40 to 70 times a second",
        sets=lambda rng: {"robot_rate": float(rng.choice([40.0, 50.0, 64.0, 70.0])), "periodic_losses": 0},
    ),
    "fast_log": Kind("the robot logs 4000 times a second", sets=lambda rng: {"robot_rate": 4000.0}),
}
