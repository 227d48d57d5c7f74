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
KINDS: dict[str, Callable[[Generator, int, float], Array]] = {**USUAL, **UNUSUAL}


def walk(rng: Generator, n: int, rate: float) -> Array:
    """A slow random walk of unit root mean square, its mean taken off."""
    steps = np.cumsum(rng.standard_normal((n, 2)), axis=0)
    return _unit(steps - steps.mean(0))
