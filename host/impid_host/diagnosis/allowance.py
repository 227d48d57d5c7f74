"""A discrepancy allowance: what is left unexplained may lean on M, B, K and alpha; their intervals say so.

A structure of rms s in a channel in which the noise has rms n moves a parameter by at most s / n times what
the noise would, were it as slow as the noise is; intervals are widened by that factor and a constant (after
Kennedy and O'Hagan, J. R. Stat. Soc. B 63, 2001). The constant is a guess: nothing has calibrated it yet.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from impid_host.diagnosis.result import Number, Stage

_LEANS = 3.0  # how much more a structure leans on a parameter than noise of its size


def widened(stage: Stage, floor: Mapping[str, float | None]) -> Stage:
    """The stage with intervals that allow for what it leaves above the floor."""
    ratios = [stage.rms[key] / level for key, level in floor.items() if level]
    over = float(np.sqrt(max(max(ratios, default=1.0) ** 2 - 1.0, 0.0)))
    factor = float(np.hypot(1.0, _LEANS * over))
    loads = {
        name: {letter: _stretched(number, factor) for letter, number in load.items()}
        for name, load in stage.loads.items()
    }
    return replace(stage, alpha=_stretched(stage.alpha, factor), loads=loads)


def _stretched(number: Number, factor: float) -> Number:
    middle = 0.5 * (number.ci95[..., 0] + number.ci95[..., 1])
    half = factor * number.half
    covariance = None if number.covariance is None else number.covariance * factor**2
    return replace(number, ci95=np.stack([middle - half, middle + half], axis=-1), covariance=covariance)
