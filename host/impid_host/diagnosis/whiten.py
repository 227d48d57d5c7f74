"""One autoregressive noise model per channel, fitted on what a saturated model leaves."""

from collections.abc import Sequence

import numpy as np
from scipy import linalg

from impid_host.diagnosis.rows import Run, Taps, mapped
from impid_host.signals.arrays import Floats

_HIGHEST_ORDER = 12


def noise_models(runs: Sequence[Run], columns: Sequence[int], floors: dict[str, float]) -> Taps:
    """Whitening taps per channel from the residual of a regression on the given columns, channel by channel.

    Args:
        columns: a set rich enough to leave nothing but noise.
        floors: smallest believable noise per family: numerical noise is no evidence.
    """
    keep = list(columns)
    taps: dict[tuple[str, int], Floats] = {}
    for key in sorted({run.key for run in runs}):
        own = [run for run in runs if run.key == key and run.part == "fit"]
        if not own:
            own = [run for run in runs if run.key == key]
        design = np.concatenate([run.design[:, keep] for run in own])
        target = np.concatenate([run.target for run in own])
        used = np.linalg.norm(design, axis=0) > 0
        design = design[:, used] / np.linalg.norm(design[:, used], axis=0)
        beta = np.linalg.lstsq(design, target, rcond=1e-8)[0] if used.any() else np.zeros(0)
        residual = target - design @ beta
        lost = min(int(used.sum()), len(target) // 2)
        inflate = np.sqrt(len(target) / max(len(target) - lost, 1))
        cuts = np.cumsum([len(run.target) for run in own])[:-1]
        taps[key] = autoregression(np.split(residual * inflate, cuts), floors.get(key[0], 0.0))
    return taps


def whitened(runs: Sequence[Run], taps: Taps) -> list[Run]:
    """Rows divided into innovations of unit variance; each run loses as many rows as its channel has taps."""

    def change(run: Run) -> tuple[Floats, Floats, int]:
        h = taps[run.key]
        lost = len(h) - 1
        stacked = np.column_stack([run.target, run.design])
        if len(stacked) <= lost:
            return stacked[:0, 0], stacked[:0, 1:], lost
        result = sum(h[k] * stacked[lost - k : len(stacked) - k] for k in range(lost + 1))
        assert isinstance(result, np.ndarray)
        return result[:, 0], result[:, 1:], lost

    return mapped(runs, change)


def autoregression(residuals: Sequence[Floats], floor: float) -> Floats:
    """AR by Yule-Walker, order by AICc; taps over the innovation's standard deviation."""
    count = sum(len(r) for r in residuals)
    highest = max(0, min(_HIGHEST_ORDER, count // 25, min(len(r) for r in residuals) // 4))
    lags = np.array(
        [sum(float(r[lag:] @ r[: len(r) - lag]) for r in residuals) / count for lag in range(highest + 1)]
    )
    lags[0] += floor**2
    best = (np.inf, np.ones(1), lags[0])
    for order in range(highest + 1):
        phi = linalg.solve_toeplitz(lags[:order], lags[1 : order + 1]) if order else np.zeros(0)
        variance = max(lags[0] - float(phi @ lags[1 : order + 1]), 1e-300)
        free = order + 1
        score = count * np.log(variance) + 2 * free + 2 * free * (free + 1) / max(count - free - 1, 1)
        if score < best[0]:
            best = (score, np.concatenate([[1.0], -phi]), variance)
    taps: Floats = best[1] / np.sqrt(max(best[2], 1e-300))
    return taps
