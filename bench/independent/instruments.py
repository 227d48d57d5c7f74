"""From signals on the fine grid to rows of files: clocks, converters, noise, losses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from . import noise as noises
from .laboratory import Instruments, Noise
from .mechanics import GRAVITY, Array
from .motion import RATE, Motion, low_pass

BAND = 10.0  # Hz; noise levels and strengths are root mean squares below it


@dataclass(frozen=True)
class Signals:
    """What reaches the instruments in one trial, on the fine grid; force along the sensor's axes."""

    theta: Array
    tau: Array
    felt: Array
    force: Array
    clock: Array  # (n,), error of the robot's time


@dataclass(frozen=True)
class Record:
    """Rows as they go to the files, and the noise in them (recorded less ideal, where the log says it is)."""

    device: dict[str, Array]
    robot: dict[str, Array]
    module_t: Array
    robot_t: Array
    torque_noise: Array
    accel_noise: Array
    force_noise: Array


def at(values: Array, m: Motion, t: Array) -> Array:
    """Values at any times, with the curvature that straight lines between grid points leave out."""
    place = (t - m.t[0]) * RATE
    left = np.clip(place.astype(int), 1, m.t.size - 3)
    u = (place - left)[:, None]
    bend = 0.25 * u * (1 - u)
    a, b = values[left], values[left + 1]
    return np.asarray(a + u * (b - a) - bend * (values[left - 1] - a - b + values[left + 2]))


def mean_over(values: Array, m: Motion, t: Array, period: float) -> Array:
    """Mean of each column over a period centred on t."""
    total = np.zeros((values.shape[0], values.shape[1]))
    # the trapezoid is off by h²/12 of the slope's change: 1e-5 of a 2 Hz signal
    total[1:] = np.cumsum(0.5 * (values[1:] + values[:-1]), axis=0) / RATE
    return (at(total, m, t + 0.5 * period) - at(total, m, t - 0.5 * period)) / period


def make_noise(rng: Generator, kind: Noise, n: int, rate: float) -> Array:
    """Noise whose root mean square below BAND is the level (quiet there, it is not blown up beyond 25 levels)."""
    raw = noises.KINDS[kind.kind](rng, n, rate)
    below = low_pass(raw, BAND, rate).std() if rate > 2.2 * BAND else 1.0
    out = raw * kind.level * min(1 / below, 25.0)
    return out + kind.walk * kind.level * noises.walk(rng, n, rate) if kind.walk else out


def _stepped(values: Array, step: float) -> Array:
    return np.round(values / step) * step if step else values


def _kept(rng: Generator, n: int, share: float, period: int) -> NDArray[np.intp]:
    keep = rng.random(n) >= share
    if period:
        keep[period::period] = False
    keep[[0, -1]] = True
    return np.flatnonzero(keep)


def _volts(ins: Instruments, accel: Array) -> Array:
    return np.asarray(np.array(ins.zero_g) + accel / GRAVITY * np.array(ins.sensitivity))


def _module(m: Motion, s: Signals, ins: Instruments, rng: Generator) -> tuple[dict[str, Array], Array, Array]:
    rate, tick = ins.module_rate, 1 + ins.module_ppm * 1e-6
    t = np.arange(int(m.plan.duration * rate)) / rate / tick
    ideal = mean_over(s.felt, m, t, 1 / rate)
    seen = ideal + make_noise(rng, ins.accel, t.size, rate)
    theta = at(s.theta, m, t)
    scale = np.array(ins.direction) * np.array(ins.counts) / (2 * np.pi)
    counts = np.round((theta - np.array(ins.zero)) * scale)
    code = np.round(_volts(ins, seen) / ins.vref * ins.full_scale_code)
    top = ins.full_scale_code - 1
    flags = ((code <= 0) | (code >= top)).any(1).astype(float)
    code = np.clip(code, 0, top)
    if not ins.ready_made:
        volts = code / ins.full_scale_code * ins.vref
        seen = (volts - np.array(ins.zero_g)) / np.array(ins.sensitivity) * GRAVITY
    if ins.sync:
        flags += 16.0 * (np.floor(t / 5.0) != np.floor((t - 1 / rate) / 5.0)) * (t > 1 / rate)
    first = np.round(m.since * rate)
    columns = {
        "t_us": np.round((first + np.arange(t.size)) / rate * 1e6),
        "seq": first + np.arange(t.size),
    }
    if ins.ready_made:
        angle = counts / scale + np.array(ins.zero)
        columns |= {"acc_x": seen[:, 0], "acc_y": seen[:, 1], "theta1": angle[:, 0], "theta2": angle[:, 1]}
    else:
        columns |= {"ax": code[:, 0], "ay": code[:, 1], "enc1": counts[:, 0], "enc2": counts[:, 1]}
    columns["flags"] = flags
    keep = _kept(rng, t.size, ins.module_losses, ins.periodic_losses)
    return {name: c[keep] for name, c in columns.items()}, t[keep], (seen - ideal)[keep]


def _robot(
    m: Motion, s: Signals, ins: Instruments, rng: Generator
) -> tuple[dict[str, Array], Array, Array, Array]:
    rate, tick = ins.robot_rate, 1 + ins.robot_ppm * 1e-6
    n = int(m.plan.duration * rate)
    begin = round(float(rng.uniform(0, 0.02)) if ins.robot_restarts else m.since * tick + 100.0, 4)
    claimed = np.arange(n) / rate / tick
    t = claimed - np.interp(claimed, m.t, s.clock)
    t = claimed - np.interp(t, m.t, s.clock)
    spread = rng.standard_t(2.5, n).clip(-8, 8) if ins.jitter_tails else rng.standard_normal(n)
    late = t + ins.jitter / rate * spread
    ideal, torque = (mean_over(s.tau, m, when, 1 / rate) for when in (t, late))
    sound = make_noise(rng, ins.torque, n, rate)
    torque = _stepped(torque + sound, ins.torque_step * float(sound.std()))
    scale = np.array(ins.direction) * np.array(ins.counts) / (2 * np.pi)
    angle = np.round((at(s.theta, m, late) - np.array(ins.zero)) * scale) / scale + np.array(ins.zero)
    columns = {
        "t": begin + np.arange(n) / rate,
        "theta1": angle[:, 0],
        "theta2": angle[:, 1],
        "tau1": torque[:, 0],
        "tau2": torque[:, 1],
    }
    force_noise = np.zeros((n, 2))
    if ins.force:
        mean = ins.force_timing == "mean"
        true, force = (mean_over(s.force, m, w, 1 / rate) if mean else at(s.force, m, w) for w in (t, late))
        sound = make_noise(rng, ins.sensor, n, rate)
        force = _stepped(force + sound, ins.force_step * float(sound.std()))
        force_noise = force - true
        columns |= {"fx": force[:, 0], "fy": force[:, 1]}
    if ins.sync:
        columns["sync"] = np.mod(np.floor(np.maximum(late, 0) / 5.0), 2)
    keep = _kept(rng, n, ins.robot_losses, ins.periodic_losses)
    rows = {name: c[keep] for name, c in columns.items()}
    return rows, t[keep], (torque - ideal)[keep], force_noise[keep]


def record(m: Motion, signals: Signals, ins: Instruments) -> Record:
    device, module_t, accel_noise = _module(m, signals, ins, m.rng(1))
    robot, robot_t, torque_noise, force_noise = _robot(m, signals, ins, m.rng(2))
    return Record(device, robot, module_t, robot_t, torque_noise, accel_noise, force_noise)
