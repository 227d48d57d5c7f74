"""The long-run covariance of a series by a kernel: Bartlett's, the bandwidth by Andrews' plug-in rule."""

from collections.abc import Sequence

import numpy as np

from impid_host.signals.arrays import Floats


def long_run_covariance(scores: Sequence[Floats]) -> tuple[Floats, float]:
    """Covariance of the sum of all stretches of scores (N, p), (p, p), and the bandwidth in rows."""
    bandwidth = _andrews_bandwidth(scores, sum(len(s) for s in scores))
    meat = sum(s.T @ s for s in scores)
    for lag in range(1, int(np.ceil(bandwidth))):
        weight = 1 - lag / bandwidth
        cross = sum(s[lag:].T @ s[:-lag] for s in scores if len(s) > lag)
        meat = meat + weight * (cross + np.transpose(cross))
    return np.asarray(meat, dtype=np.float64), bandwidth


def _andrews_bandwidth(scores: Sequence[Floats], rows: int) -> float:
    """Andrews (1991), Bartlett kernel, AR(1) plug-in averaged over the parameters' scores."""
    now = np.concatenate([s[1:] for s in scores if len(s) > 1])
    before = np.concatenate([s[:-1] for s in scores if len(s) > 1])
    rho = np.sum(now * before, axis=0) / np.maximum(np.sum(before**2, axis=0), 1e-300)
    rho = np.clip(rho, -0.95, 0.97)
    variance = np.var(now - rho * before, axis=0)
    weight = 1 / np.maximum(variance, 1e-150) ** 2
    top = np.sum(weight * 4 * rho**2 * variance**2 / ((1 - rho) ** 6 * (1 + rho) ** 2))
    bottom = np.sum(weight * variance**2 / (1 - rho) ** 4)
    return float(np.clip(1.1447 * (top / max(bottom, 1e-300) * rows) ** (1 / 3), 1.0, max(1.0, rows / 10)))
