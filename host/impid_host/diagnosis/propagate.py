"""The effects' uncertainty taken through a fit by finite differences."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from impid_host.diagnosis.parameters import at, vector_of
from impid_host.diagnosis.result import Chosen
from impid_host.impedance.linear import Estimate
from impid_host.signals.arrays import Floats

Fit = TypeVar("Fit")


@dataclass(frozen=True, slots=True)
class Steps:
    """By how much each parameter of the effects is moved, (k,), and their covariance, (k, k)."""

    size: Floats
    covariance: Floats

    def wider(self, own: Estimate, here: Estimate, moved: Sequence[Estimate]) -> Estimate:
        """The estimate with what the effects leave open in its covariance.

        What is left of the effects' errors is orthogonal to the errors at known effects (partitioned least
        squares), so the two covariances add.

        Args:
            here, moved: at the effects' values, and with each parameter moved by its step.
        """
        slope = np.stack([(o.value - here.value) / s for o, s in zip(moved, self.size, strict=True)], axis=1)
        return replace(own, covariance=own.covariance + slope @ self.covariance @ slope.T)


def moved_fits(
    chosen: Sequence[Chosen], covariance: Floats, fitted: Callable[[Sequence[Chosen]], Fit], workers: int = 2
) -> tuple[Steps, Fit, list[Fit]]:
    """The steps, the fit at the effects' values, and one for each parameter moved by a standard deviation."""
    vector, sd = vector_of(chosen), np.sqrt(np.maximum(np.diag(covariance), 0.0))
    size = np.maximum(sd, np.maximum(1e-9 * np.abs(vector), 1e-15))
    with ThreadPoolExecutor(workers) as pool:
        moves = [at(chosen, vector + step * row) for step, row in zip(size, np.eye(len(vector)), strict=True)]
        here, *moved = pool.map(fitted, [chosen, *moves])
    return Steps(size, covariance), here, moved
