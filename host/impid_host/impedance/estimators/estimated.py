"""By which estimator a robot or a load was estimated, and why."""

from dataclasses import dataclass
from typing import Literal

Estimator = Literal["least-squares", "instruments", "output-error"]
EstimatorWish = Literal["least-squares", "instruments", "output-error", "auto"]
ESTIMATORS: tuple[EstimatorWish, ...] = ("least-squares", "instruments", "output-error", "auto")


@dataclass(frozen=True, slots=True)
class Estimated:
    """An answer to `--estimator`.

    Attributes:
        by: the estimator whose numbers stand.
        reason: one sentence: that it was asked for, or the evidence.
        instruments: where they came from; None where there are none.
        bias_sd: of least squares against instruments, the parameter that moved most, in its standard
            deviations, and the most that it may be at 95 %; None where the two were not compared.
    """

    by: Estimator
    reason: str
    instruments: Literal["simulated model", "angles"] | None = None
    bias_sd: tuple[float, float] | None = None

    def __str__(self) -> str:
        by = self.by.replace("-", " ") + (f" ({self.instruments})" if self.by == "instruments" else "")
        return f"Estimated by {by}: {self.reason}"
