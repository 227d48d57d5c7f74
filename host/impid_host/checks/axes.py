"""How a sensor of two axes in a plane is turned, mirrored and scaled: from a fitted 2 x 2 map."""

from dataclasses import dataclass

import numpy as np

from impid_host.checks.equations import turned
from impid_host.checks.factors import Factor, nearest
from impid_host.signals.arrays import Floats

_QUARTER = 0.12
LEAST_TURN = 0.15
_SQUARE = 0.3
_FEW_ROWS = 20


@dataclass(frozen=True, slots=True)
class AxisMap:
    """reading = gain * (mirrored?) R(-angle) @ vector + bias.

    Attributes:
        turn: from where the sensor is said to be, rad, counter-clockwise; a whole quarter where it is near
            one, 0 where it is small.
        mirrored: its second axis points the other way.
        gains: of the two axes, None where about 1.
        raw: the fitted map against the declared place, (2, 2); bias (2,).
        left: share of the reading that the fitted map leaves, (2,).
        sd: rough standard deviation of an entry of `raw`.
    """

    turn: float
    mirrored: bool
    gains: tuple[Factor | None, Factor | None]
    raw: Floats
    bias: Floats
    left: Floats
    sd: float

    @property
    def is_map(self) -> bool:
        """Whether two axes at a right angle explain the readings."""
        rows = self.raw / np.maximum(np.linalg.norm(self.raw, axis=1, keepdims=True), 1e-12)
        return bool(abs(rows[0] @ rows[1]) < _SQUARE and np.all(self.left < 0.5))

    @property
    def off(self) -> bool:
        """Whether it is anything but the declared sensor."""
        return self.turn != 0 or self.mirrored or any(gain is not None for gain in self.gains)

    @property
    def deviation(self) -> float:
        """Largest departure of the map from the declared one, 1."""
        return float(np.abs(self.raw - np.eye(2)).max())


def axis_map(reading: Floats, expected: Floats) -> AxisMap | None:
    """Fit reading = A expected + b, both (R, 2) along the declared axes; None where nothing moves."""
    if len(reading) < _FEW_ROWS or np.min(np.std(expected, axis=0)) < 1e-9:
        return None
    design = np.concatenate([expected, np.ones((len(expected), 1))], axis=1)
    size = np.linalg.norm(design, axis=0)
    value, *_ = np.linalg.lstsq(design / size, reading, rcond=None)
    value = value / size[:, None]
    rest = reading - design @ value
    A, bias = value[:2].T, value[2]
    left = np.std(rest, axis=0) / np.maximum(np.std(reading, axis=0), 1e-12)
    sd = float(np.max(np.std(rest, axis=0) / np.min(np.std(expected, axis=0))) / np.sqrt(len(rest) / 10))
    turn = float(np.arctan2(A[0, 1], A[0, 0]))
    mirrored = bool(np.linalg.det(A) < 0)
    if mirrored:
        # Turn shared between both rows: the second points to -90 degrees of the first.
        turn = float(np.arctan2(A[0, 1] + A[1, 0], A[0, 0] - A[1, 1]))
    else:
        turn = float(np.arctan2(A[0, 1] - A[1, 0], A[0, 0] + A[1, 1]))
    gains = np.linalg.norm(A, axis=1)
    return AxisMap(_snapped(turn), mirrored, (nearest(gains[0]), nearest(gains[1])), A, bias, left, sd)


def corrected(values: Floats, found: AxisMap) -> Floats:
    """A reading (N, 2) along the axes that were declared."""
    factors = np.array([1.0 if gain is None else gain.value for gain in found.gains])
    signs = np.array([1.0, -1.0 if found.mirrored else 1.0])
    return turned(values * signs / factors, found.turn)


def _snapped(turn: float) -> float:
    quarter = np.round(turn / (np.pi / 2)) * (np.pi / 2)
    if abs(turn - quarter) < _QUARTER:
        return float(quarter)
    return turn if abs(turn) > LEAST_TURN else 0.0
