"""Noise by its kind. Every generator returns (n, 2) with two independent columns of unit root mean square
(in expectation), sampled at ``rate``; the caller scales.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]


def _unit(values: Array) -> Array:
    return np.asarray(values / np.sqrt(np.mean(values**2, axis=0, keepdims=True)))


def white(rng: Generator, n: int, rate: float) -> Array:
    return rng.standard_normal((n, 2))


def pink(rng: Generator, n: int, rate: float) -> Array:
    """Power as 1/f above 0.05 Hz, flat below."""
    spectrum = np.fft.rfft(rng.standard_normal((n, 2)), axis=0)
    f = np.fft.rfftfreq(n, 1 / rate)[:, None]
    return _unit(np.fft.irfft(spectrum / np.sqrt(np.maximum(f, 0.05)), n, axis=0))


def ar1(rng: Generator, n: int, rate: float) -> Array:
    """First order with a corner between 3 and 40 Hz."""
    pole = np.exp(-2 * np.pi * rng.uniform(3, 40) / rate)
    return _unit(lfilter([1], [1, -pole], rng.standard_normal((n, 2)), axis=0))


def ar2(rng: Generator, n: int, rate: float) -> Array:
    """A broad resonance somewhere between 5 and 40 Hz beside white noise."""
    angle = 2 * np.pi * rng.uniform(5, min(40, 0.4 * rate)) / rate
    r = np.exp(-2 * np.pi * rng.uniform(2, 8) / rate)
    ringing = lfilter([1], [1, -2 * r * np.cos(angle), r * r], rng.standard_normal((n, 2)), axis=0)
    return _unit(_unit(ringing) + 0.7 * rng.standard_normal((n, 2)))


def violet(rng: Generator, n: int, rate: float) -> Array:
    """Differences of white noise beside a third of white noise."""
    raw = rng.standard_normal((n + 1, 2))
    return _unit(np.diff(raw, axis=0) + 0.5 * rng.standard_normal((n, 2)))


def _student(freedom: float) -> Callable[[Generator, int, float], Array]:
    def generator(rng: Generator, n: int, rate: float) -> Array:
        # clipped where a converter would clip: a single sample is no story of its own
        return _unit(np.clip(rng.standard_t(freedom, (n, 2)), -60, 60))

    return generator


def laplace(rng: Generator, n: int, rate: float) -> Array:
    return np.asarray(rng.laplace(size=(n, 2)) / np.sqrt(2))


def shot(rng: Generator, n: int, rate: float) -> Array:
    """Sparse pulses of random sign and size on a quiet ground."""
    hits = rng.random((n, 2)) < rng.uniform(0.002, 0.02)
    return _unit(0.4 * rng.standard_normal((n, 2)) + hits * rng.normal(0, 6, (n, 2)))


def bursts(rng: Generator, n: int, rate: float) -> Array:
    """The spread jumps between 0.5 and 3 for stretches of 0.2 to 4 s."""
    edges = np.cumsum(rng.uniform(0.2, 4, size=int(n / rate / 0.2) + 2) * rate).astype(int)
    level = rng.choice([0.5, 0.7, 1.0, 3.0], size=edges.size + 1)
    return _unit(level[np.searchsorted(edges, np.arange(n))][:, None] * rng.standard_normal((n, 2)))


def swelling(rng: Generator, n: int, rate: float) -> Array:
    """The spread follows a slow random curve (log-normal)."""
    slow = np.interp(np.arange(n), np.linspace(0, n, 12), rng.normal(0, 0.6, 12))
    return _unit(np.exp(slow)[:, None] * rng.standard_normal((n, 2)))


def uniform(rng: Generator, n: int, rate: float) -> Array:
    return rng.uniform(-np.sqrt(3), np.sqrt(3), (n, 2))


def skewed(rng: Generator, n: int, rate: float) -> Array:
    """Exponential noise less its mean."""
    return rng.exponential(size=(n, 2)) - 1.0


def telegraph(rng: Generator, n: int, rate: float) -> Array:
    """A random two-level signal that flips 20 to 200 times a second (popcorn noise), beside white noise."""
    flips = rng.random((n, 2)) < min(rng.uniform(20, 200) / rate, 0.5)
    return _unit(0.6 * (1 - 2 * (np.cumsum(flips, axis=0) % 2)) + rng.standard_normal((n, 2)))


def garch(rng: Generator, n: int, rate: float) -> Array:
    """Large samples breed large samples: the variance follows the filtered square of an earlier noise."""
    driver = lfilter([0.02], [1, -0.98], rng.standard_normal((n, 2)) ** 2, axis=0)
    return _unit(np.sqrt(0.1 + driver**3) * rng.standard_normal((n, 2)))


def hum(rng: Generator, n: int, rate: float) -> Array:
    """Mains hum and its third harmonic beside white noise a sixth of their size; above the band unless folded."""
    t, f = np.arange(n)[:, None] / rate, rng.choice([50.0, 60.0]) + rng.uniform(-0.05, 0.05)
    phase = rng.uniform(0, 2 * np.pi, (2, 2))
    lines = [k for k in (1, 3) if abs(k * f - rate * np.round(k * f / rate)) > 12]
    wave = sum((np.sin(2 * np.pi * k * f * t + phase[k // 2]) / k for k in lines), np.zeros((n, 2)))
    return _unit(6 * wave + rng.standard_normal((n, 2)))


def common(rng: Generator, n: int, rate: float) -> Array:
    """Both columns hear one supply, with either sign, and little of their own."""
    shared = pink(rng, n, rate)[:, :1]
    return _unit(shared * rng.choice([-1, 1], 2) + 0.3 * rng.standard_normal((n, 2)))


def sparkles(rng: Generator, n: int, rate: float) -> Array:
    """One sample in some thousands is off by tens of the spread."""
    hits = rng.random((n, 2)) < rng.uniform(1e-4, 4e-4)
    return np.asarray(
        rng.standard_normal((n, 2)) + hits * rng.choice([-1, 1], (n, 2)) * rng.uniform(15, 40, (n, 2))
    )


def stable(rng: Generator, n: int, rate: float) -> Array:
    """A symmetric stable law of index 1.6 to 1.9 (Chambers, Mallows and Stuck 1976), clipped as a converter would."""
    a = rng.uniform(1.6, 1.9)
    v, w = rng.uniform(-np.pi / 2, np.pi / 2, (n, 2)), rng.exponential(size=(n, 2))
    raw = np.sin(a * v) / np.cos(v) ** (1 / a) * (np.cos((1 - a) * v) / w) ** ((1 - a) / a)
    return _unit(np.clip(raw, -50, 50))


def sweeping(rng: Generator, n: int, rate: float) -> Array:
    """A tone that wanders between 14 and 40 Hz (or below two fifths of the rate) beside white noise."""
    knots = rng.uniform(14, min(40, 0.4 * rate), 30)
    f = np.interp(np.arange(n), np.linspace(0, n, 30), knots)
    phase = 2 * np.pi * np.cumsum(f)[:, None] / rate + rng.uniform(0, 2 * np.pi, 2)
    return _unit(1.5 * np.sin(phase) + rng.standard_normal((n, 2)))


def interleaved(rng: Generator, n: int, rate: float) -> Array:
    """Two converters take turns: every second sample stands off by one and a half of the spread."""
    turns = 1.5 * (1 - 2 * (np.arange(n) % 2))[:, None]
    return _unit(turns * rng.choice([-1, 1], 2) + rng.standard_normal((n, 2)))


def compressor(rng: Generator, n: int, rate: float) -> Array:
    """The spread doubles for a third of each period of 9 to 20 s."""
    share = np.mod(np.arange(n) / rate / rng.uniform(9, 20) + rng.random(), 1.0)
    return _unit(np.where(share < 1 / 3, 2.0, 1.0)[:, None] * rng.standard_normal((n, 2)))


def long_memory(rng: Generator, n: int, rate: float) -> Array:
    """Power as f^-0.6 down to the record's own length."""
    spectrum = np.fft.rfft(rng.standard_normal((n, 2)), axis=0)
    f = np.fft.rfftfreq(n, 1 / rate)[:, None]
    f[0] = f[1]
    return _unit(np.fft.irfft(spectrum / f**0.3, n, axis=0))


def averaged(rng: Generator, n: int, rate: float) -> Array:
    """A moving mean over 30 ms of white noise."""
    window = max(2, round(0.03 * rate))
    return _unit(
        lfilter(np.ones(window) / window, [1], rng.standard_normal((n + window, 2)), axis=0)[window:]
    )


def held(rng: Generator, n: int, rate: float) -> Array:
    """One value for 15 to 40 ms at a time."""
    span = max(2, round(rng.uniform(0.015, 0.04) * rate))
    return np.repeat(rng.standard_normal((n // span + 1, 2)), span, axis=0)[:n]


def dying(rng: Generator, n: int, rate: float) -> Array:
    """The spread falls from three to one within the record."""
    spread = 1 + 2 * np.exp(-np.linspace(0, 4, n))
    return _unit(spread[:, None] * rng.standard_normal((n, 2)))


def raindrops(rng: Generator, n: int, rate: float) -> Array:
    """One-sided pulses, 40 a second, that fade within 8 ms, their mean taken off, beside white noise."""
    fade = np.exp(-1 / (0.008 * rate))
    drops = (rng.random((n, 2)) < min(0.5, 40 / rate)) * rng.exponential(size=(n, 2))
    rain = lfilter([1], [1, -fade], drops, axis=0)
    return _unit(2 * (rain - rain.mean(0)) / rain.std(0) + rng.standard_normal((n, 2)))


def two_codes(rng: Generator, n: int, rate: float) -> Array:
    """A reading that toggles between two values at random."""
    return rng.choice([-1.0, 1.0], (n, 2)) + 0.05 * rng.standard_normal((n, 2))


USUAL = {"white": white, "pink": pink, "ar1": ar1}
UNUSUAL = {
    "ar2": ar2,
    "violet": violet,
    "student_2.5": _student(2.5),
    "student_4": _student(4.0),
    "laplace": laplace,
    "shot": shot,
    "bursts": bursts,
    "swelling": swelling,
    "uniform": uniform,
    "skewed": skewed,
    "telegraph": telegraph,
    "garch": garch,
    "pink": pink,
}
FRESH = {
    "hum": hum,
    "common": common,
    "sparkles": sparkles,
    "stable": stable,
    "sweeping": sweeping,
    "interleaved": interleaved,
    "compressor": compressor,
    "long_memory": long_memory,
    "averaged": averaged,
    "held": held,
    "dying": dying,
    "raindrops": raindrops,
    "two_codes": two_codes,
}  # asked for by harmless only: the draws of earlier seeds stay what they were
KINDS: dict[str, Callable[[Generator, int, float], Array]] = {**USUAL, **UNUSUAL, **FRESH}


def walk(rng: Generator, n: int, rate: float) -> Array:
    """A slow random walk of unit root mean square, its mean taken off."""
    steps = np.cumsum(rng.standard_normal((n, 2)), axis=0)
    return _unit(steps - steps.mean(0))
