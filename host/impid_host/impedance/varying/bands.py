"""Simultaneous 95 % bands from draws of a posterior: the whole curve lies inside with 95 %."""

from dataclasses import dataclass

import numpy as np

from impid_host.impedance.loads import LoadModel, Signal
from impid_host.impedance.varying.posterior import Layout
from impid_host.signals.arrays import Floats

LEVEL = 0.95


@dataclass(frozen=True, slots=True)
class Band:
    """A curve (k,) between `low` and `high`, and its pointwise standard deviation; a constant has k = 1."""

    value: Floats
    low: Floats
    high: Floats
    sd: Floats
    unit: str


def band(draws: Floats, unit: str) -> Band:
    """From draws (n, k): the smallest multiple of the pointwise spread that holds 95 % of whole curves.

    Middle and spread are by quantiles, so that a ratio's rare far draws do not set them.
    """
    low, middle, high = np.percentile(draws, [15.87, 50.0, 84.13], axis=0)
    sd = np.maximum(0.5 * (high - low), 1e-300)
    widest = np.max(np.abs(draws - middle) / sd, axis=1)
    half = float(np.quantile(widest, LEVEL)) * sd
    return Band(middle, middle - half, middle + half, sd, unit)


def constants(draws: Floats, load: LoadModel, signal: Signal, taken_off: float = 0.0) -> dict[str, Band]:
    """Entries that do not vary, by name; `taken_off` a handle's mass, where it moves with the load."""
    off = taken_off if load.carries_handle and signal == "a" else 0.0
    return {
        column.name: band(draws[:, [q]] - off * (column.entries[0][0] == column.entries[0][1]), column.unit)
        for q, column in enumerate(load.columns)
        if column.signal == signal
    }


def drawn_bands(
    draws: Floats, layout: Layout, load: LoadModel, places: Floats, origin: Floats
) -> dict[str, Band]:
    """K, B and x0 at `places`, by name.

    Args:
        draws: (n, p) parameters; origin: (d,) the position from which the load was taken.
    """
    d, n, k = len(load.axes), len(draws), len(places)
    curves = {q: draws @ layout.curve(q, places).T for q in range(len(load.columns))}
    out = {
        column.name: band(curves[q], column.unit)
        for q, column in enumerate(load.columns)
        if column.signal in ("x", "v")
    }
    K = np.zeros((n, k, d, d))
    for q, column in enumerate(load.columns):
        if column.signal == "x":
            for row, axis in column.entries:
                K[:, :, row, axis] = curves[q]
    c = np.stack([curves[q] for q in load.place], axis=2)
    with np.errstate(all="ignore"):
        x0 = origin + np.linalg.solve(K, c[..., None])[..., 0]
    for axis, name in enumerate(load.axes):
        out[f"{name}0"] = band(x0[:, :, axis], load.place_unit)
    return out
