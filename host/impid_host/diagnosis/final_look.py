"""The one look at held-out data: an effect that does not lower the error there is not claimed."""

from collections.abc import Sequence

import numpy as np

from impid_host.diagnosis.rows import Run
from impid_host.signals.arrays import Floats


def carried(runs: Sequence[Run], base: int, sizes: Sequence[int]) -> list[int]:
    """Places of the effects without which the held-out squares would be larger.

    Args:
        runs: whitened, of both parts; columns are the base's, then each effect's in turn.
        base: columns of the base; sizes: of each effect.
    """
    stops = base + np.cumsum(sizes)
    own = [np.arange(stop - size, stop) for stop, size in zip(stops, sizes, strict=True)]
    fit, held = _stacked(runs, "fit"), _stacked(runs, "validation")
    kept = list(range(len(sizes)))
    while kept and len(held[0]):
        always = np.concatenate([np.arange(base), *(own[k] for k in kept)])
        all_in = _squares(fit, held, always)
        worth = [_squares(fit, held, always[~np.isin(always, own[k])]) - all_in for k in kept]
        worst = int(np.argmin(worth))
        if worth[worst] > 0.0:
            break
        kept.pop(worst)
    return kept


def _stacked(runs: Sequence[Run], part: str) -> tuple[Floats, Floats]:
    chosen = [run for run in runs if run.part == part]
    if not chosen:
        width = runs[0].design.shape[1] if runs else 0
        return np.zeros(0), np.zeros((0, width))
    return np.concatenate([run.target for run in chosen]), np.concatenate([run.design for run in chosen])


def _squares(fit: tuple[Floats, Floats], held: tuple[Floats, Floats], columns: Floats) -> float:
    """Held-out residual sum of squares of a regression on these columns of the fit part."""
    design = fit[1][:, columns]
    size = np.linalg.norm(design, axis=0) + 1e-300
    beta = np.linalg.lstsq(design / size, fit[0], rcond=1e-10)[0] / size
    return float(np.sum((held[0] - held[1][:, columns] @ beta) ** 2))
