"""Factors that people lose: units, decoding, turns. A factor is named only where it is near one of these."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Factor:
    """What a channel was multiplied by, and what that usually is."""

    value: float
    words: str

    def __str__(self) -> str:
        return f"{self.value:.6g}"


_KNOWN = (
    (2.0, ""),
    (3.0, ""),
    (4.0, "edges of a quadrature"),
    (8.0, ""),
    (16.0, "12 bits for 16"),
    (64.0, "10 bits for 16"),
    (9.80665, "kgf for N, or g for m/s^2"),
    (98.0665, "kgf cm"),
    (4.4482216, "pounds of force"),
    (1.3558179, "foot pounds"),
    (8.8507458, "inch pounds"),
    (10.0, ""),
    (100.0, "cm for m, or per cent"),
    (1e3, "thousandths"),
    (1e6, "millionths"),
    (180 / np.pi, "degrees for radians"),
    (2 * np.pi, "turns for radians"),
    (np.pi, "pi"),
    (60.0, "minutes for seconds"),
    (360.0, "degrees for turns"),
    (25.4, "inches and mm"),
    (39.3701, "inches for m"),
    (3.2808399, "feet for m"),
)


def _known() -> tuple[Factor, ...]:
    both = []
    for k, note in _KNOWN:
        both.append(Factor(k, f"{k:.6g} ({note})" if note else f"{k:.6g}"))
        both.append(Factor(1 / k, f"{1 / k:.4g} (1/{k:.6g}{', ' + note if note else ''})"))
    return tuple(both)


KNOWN = _known()
# Those that befall one channel of several.
LIKELY = tuple(
    factor
    for factor in KNOWN
    if any(abs(np.log(factor.value)) == abs(np.log(k)) for k in (2.0, 4.0, 9.80665, 10.0, 100.0, 1e3))
)
CLOSE = 0.04
# Within this of 1 it is a gain, which a drive or a sensor may have, and not a mistake.
LEAST = 1.25


def nearest(value: float) -> Factor | None:
    """The factor behind a measured one; a number of its own where none is near; None where it is about 1."""
    if not np.isfinite(value) or value <= 0 or 1 / LEAST < value < LEAST:
        return None
    near = min(KNOWN, key=lambda known: abs(np.log(value / known.value)))
    if abs(value / near.value - 1) < CLOSE:
        return near
    return Factor(float(f"{value:.4g}"), f"{value:.3g}")
