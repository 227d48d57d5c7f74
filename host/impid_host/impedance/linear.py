"""Linear least squares whose 95 % intervals hold when the residual is coloured.

Rows come as contiguous stretches, so that neighbours in an array are neighbours in time. First ordinary
least squares; then the residual's autoregression (order by BIC, one per channel, pooled over stretches)
prewhitens both sides and the fit is repeated; last, a kernel estimate (Bartlett, Andrews' plug-in bandwidth)
of the scores' long-run covariance takes up what correlation is left, between channels too. With `ar_order` 0
the middle step is left out.

A kernel estimate errs on the small side in short records: its variance is widened by Kiefer and Vogelsang's
critical values (Econometric Theory 21, 2005, Bartlett kernel), and after prewhitening no standard deviation
is let below the conventional one (Angrist and Pischke 2009, sec. 8.1).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg, stats

from impid_host.errors import UndeterminedError
from impid_host.signals.arrays import Floats

_MAX_CONDITION = 1e7
_ROUNDS = 3
_ROUNDING = 1e-7  # a column so much smaller than the largest one is a filter's rounding
_HAUSMAN_SIGMAS = 3.0


@dataclass(frozen=True, slots=True)
class Stretch:
    """Contiguous, evenly spaced rows of `target = design @ value + residual`; c channels, p parameters.

    Attributes:
        design: (N, c, p).
        target: (N, c).
        nuisance: (N, c, k), d target / d (parameters known from elsewhere), or None.
    """

    design: Floats
    target: Floats
    nuisance: Floats | None = None


@dataclass(frozen=True, slots=True)
class Estimate:
    """Estimated parameters.

    Attributes:
        names, units: of the p parameters.
        value: (p,).
        covariance: (p, p), with whatever was propagated from earlier fits.
        dof: degrees of freedom behind the covariance.
        rows: number of rows (instants) used.
        residual_rms: per channel, in the target's unit, before prewhitening.
        relative_error_percent: 100 |target - fit| / |target| over all channels.
        ar_order: order of the prewhitening per channel.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    value: Floats
    covariance: Floats
    dof: float
    rows: int
    residual_rms: Floats
    relative_error_percent: float
    ar_order: tuple[int, ...]

    @property
    def sd(self) -> Floats:
        """Standard deviations, (p,)."""
        result: Floats = np.sqrt(np.diag(self.covariance))
        return result

    @property
    def ci95(self) -> Floats:
        """95 % intervals, (p, 2)."""
        half = stats.t.ppf(0.975, self.dof) * self.sd
        return np.stack([self.value - half, self.value + half], axis=1)

    def __getitem__(self, name: str) -> float:
        return float(self.value[self.names.index(name)])


def fit_linear(
    stretches: Sequence[Stretch],
    names: tuple[str, ...],
    units: tuple[str, ...],
    *,
    ar_order: int = 8,
    nuisance_covariance: Floats | None = None,
) -> Estimate:
    """Least squares over all stretches.

    Args:
        ar_order: highest order of the prewhitening; 0 gives ordinary least squares.
        nuisance_covariance: (k, k) of the parameters behind `Stretch.nuisance`; their uncertainty is
            propagated.

    Raises:
        UndeterminedError: too few rows, or a combination of parameters that the rows do not determine
            (named).
    """
    parameters = len(names)
    rows = sum(len(stretch.target) for stretch in stretches)
    if rows < 5 * parameters:
        raise UndeterminedError(f"{rows} usable rows for {parameters} parameters; longer trials are needed")
    scale = 1 / np.sqrt(np.mean(np.concatenate([s.target for s in stretches]) ** 2, axis=0) + 1e-300)
    work = [_weighted(stretch, np.full(len(scale), np.median(scale))) for stretch in stretches]
    _require_determined(work, names)
    value = _solve(work)
    covariance, dof = _sandwich(work, value)
    orders: tuple[int, ...] = (0,) * len(scale)
    if ar_order > 0:
        white, white_value, white_orders = _prewhitened_fit(stretches, value, ar_order)
        if np.all(np.abs(white_value - value) < _HAUSMAN_SIGMAS * np.sqrt(np.diag(covariance))):
            work, value, orders = white, white_value, white_orders
            covariance, dof = _sandwich(work, value)
            covariance = _not_below(covariance, _conventional(work, value))
    if nuisance_covariance is not None:
        gain = _nuisance_gain(work)
        covariance = covariance + gain @ nuisance_covariance @ gain.T
    residual = np.concatenate([_residual(stretch, value) for stretch in stretches])
    target = np.concatenate([stretch.target for stretch in stretches])
    return Estimate(
        names=names,
        units=units,
        value=value,
        covariance=covariance,
        dof=dof,
        rows=rows,
        residual_rms=np.sqrt(np.mean(residual**2, axis=0)),
        relative_error_percent=float(100 * np.linalg.norm(residual) / np.linalg.norm(target)),
        ar_order=orders,
    )


def _prewhitened_fit(
    stretches: Sequence[Stretch], value: Floats, ar_order: int
) -> tuple[list[Stretch], Floats, tuple[int, ...]]:
    """Whitened rows, their least-squares solution, and the autoregression's order per channel."""
    work: list[Stretch] = []
    filters: list[Floats] = []
    for _ in range(_ROUNDS):
        residuals = [_residual(stretch, value) for stretch in stretches]
        channels = range(residuals[0].shape[1])
        filters = [_whitener([r[:, c] for r in residuals], ar_order) for c in channels]
        work = [white for stretch in stretches if (white := _whitened(stretch, filters)) is not None]
        value = _solve(work)
    return work, value, tuple(len(taps) - 1 for taps in filters)


def _residual(stretch: Stretch, value: Floats) -> Floats:
    result: Floats = stretch.target - stretch.design @ value
    return result


def _weighted(stretch: Stretch, weight: Floats) -> Stretch:
    nuisance = None if stretch.nuisance is None else stretch.nuisance * weight[:, None]
    return Stretch(stretch.design * weight[:, None], stretch.target * weight, nuisance)


def _normal(work: Sequence[Stretch]) -> Floats:
    total: Floats = sum(np.einsum("kcp,kcq->pq", s.design, s.design) for s in work)
    return total


def _solve(work: Sequence[Stretch]) -> Floats:
    moment = sum(np.einsum("kcp,kc->p", s.design, s.target) for s in work)
    normal = _normal(work)
    size = np.sqrt(np.diag(normal))
    result: Floats = np.linalg.solve(normal / np.outer(size, size), moment / size) / size
    return result


def _require_determined(work: Sequence[Stretch], names: tuple[str, ...]) -> None:
    normal = _normal(work)
    size = np.sqrt(np.diag(normal))
    still = size <= _ROUNDING * size.max()
    if np.any(still):
        flat = ", ".join(name for name, none in zip(names, still, strict=True) if none)
        raise UndeterminedError(f"nothing in these trials depends on {flat}; move the joints that it acts on")
    eigenvalues, vectors = np.linalg.eigh(normal / np.outer(size, size))
    if eigenvalues[0] * _MAX_CONDITION**2 < eigenvalues[-1]:
        direction = vectors[:, 0] / size
        direction = direction / np.abs(direction).max()
        parts = [f"{v:+.2g} {n}" for v, n in zip(direction, names, strict=True) if abs(v) > 0.05]
        raise UndeterminedError(
            f"the combination {' '.join(parts)} is not determined by these trials; a richer motion is needed"
        )


def _whitener(residuals: Sequence[Floats], highest: int) -> Floats:
    """Taps that whiten the channel and scale it to unit variance: AR by Yule-Walker, order by BIC."""
    count = sum(len(r) for r in residuals)
    highest = max(0, min(highest, count // 20, min(len(r) for r in residuals) // 4))
    lags = np.array(
        [sum(float(r[lag:] @ r[: len(r) - lag]) for r in residuals) for lag in range(highest + 1)]
    )
    lags = lags / count
    best: tuple[float, Floats] = (np.inf, np.ones(1))
    for order in range(highest + 1):
        taps = linalg.solve_toeplitz(lags[:order], lags[1 : order + 1]) if order else np.zeros(0)
        variance = max(float(lags[0] - taps @ lags[1 : order + 1]), 1e-12 * float(lags[0]) + 1e-300)
        bic = count * np.log(variance) + order * np.log(count)
        if bic < best[0]:
            best = (bic, np.concatenate([[1.0], -taps]) / np.sqrt(variance))
    return best[1]


def _whitened(stretch: Stretch, filters: Sequence[Floats]) -> Stretch | None:
    """The stretch through its channels' filters; None when it is shorter than the filter."""
    lost = max(len(taps) for taps in filters) - 1
    if len(stretch.target) <= lost:
        return None

    def run(values: Floats) -> Floats:
        out = np.empty_like(values)
        for c, taps in enumerate(filters):
            channel = values[:, c]
            out[:, c] = sum(tap * _delayed(channel, lag) for lag, tap in enumerate(taps))
        return out[lost:]

    nuisance = None if stretch.nuisance is None else run(stretch.nuisance)
    return Stretch(run(stretch.design), run(stretch.target), nuisance)


def _delayed(values: Floats, lag: int) -> Floats:
    return values if lag == 0 else np.concatenate([np.zeros_like(values[:lag]), values[:-lag]])


def _nuisance_gain(work: Sequence[Stretch]) -> Floats:
    """d value / d nuisance parameters, (p, k)."""
    cross = sum(np.einsum("kcp,kcq->pq", s.design, s.nuisance) for s in work if s.nuisance is not None)
    result: Floats = np.linalg.solve(_normal(work), cross)
    return result


def _sandwich(work: Sequence[Stretch], value: Floats) -> tuple[Floats, float]:
    scores = [np.einsum("kcp,kc->kp", s.design, _residual(s, value)) for s in work]
    rows = sum(len(s) for s in scores)
    parameters = len(value)
    bandwidth = _andrews_bandwidth(scores, rows)
    meat = sum(s.T @ s for s in scores)
    for lag in range(1, int(np.ceil(bandwidth))):
        weight = 1 - lag / bandwidth
        cross = sum(s[lag:].T @ s[:-lag] for s in scores if len(s) > lag)
        meat = meat + weight * (cross + np.transpose(cross))
    channels = work[0].target.shape[1]
    # 1.96 + 2.9694 b is the 97.5 % point when the bandwidth is a share b of the rows.
    widening = (1 + 2.9694 * bandwidth / rows / 1.96) ** 2
    correction = widening * rows * channels / max(rows * channels - parameters, 1)
    bread = np.linalg.inv(_normal(work))
    dof = max(1.5 * rows / max(bandwidth, 1.0) - parameters, 3.0)
    return bread @ meat @ bread * correction, dof


def _conventional(work: Sequence[Stretch], value: Floats) -> Floats:
    """Covariance (p, p) if the rows were white and of one variance."""
    residual = np.concatenate([_residual(stretch, value) for stretch in work])
    variance = float(np.sum(residual**2)) / max(residual.size - len(value), 1)
    return np.asarray(variance * np.linalg.inv(_normal(work)), dtype=np.float64)


def _not_below(covariance: Floats, floor: Floats) -> Floats:
    """The covariance with its standard deviations raised to those of `floor`, correlations kept."""
    raised = np.sqrt(np.maximum(np.diag(floor) / np.maximum(np.diag(covariance), 1e-300), 1.0))
    return np.asarray(covariance * np.outer(raised, raised), dtype=np.float64)


def _andrews_bandwidth(scores: Sequence[Floats], rows: int) -> float:
    """Andrews (1991), Bartlett kernel, AR(1) plug-in averaged over the parameters' scores."""
    now = np.concatenate([s[1:] for s in scores if len(s) > 1])
    before = np.concatenate([s[:-1] for s in scores if len(s) > 1])
    rho = np.sum(now * before, axis=0) / np.maximum(np.sum(before**2, axis=0), 1e-300)
    rho = np.clip(rho, -0.95, 0.97)
    variance = np.var(now - rho * before, axis=0)
    weight = 1 / np.maximum(variance, 1e-300) ** 2
    top = np.sum(weight * 4 * rho**2 * variance**2 / ((1 - rho) ** 6 * (1 + rho) ** 2))
    bottom = np.sum(weight * variance**2 / (1 - rho) ** 4)
    return float(np.clip(1.1447 * (top / bottom * rows) ** (1 / 3), 1.0, max(1.0, rows / 10)))
