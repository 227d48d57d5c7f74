"""Linear least squares whose 95 % intervals hold when the residual is coloured.

Rows come as contiguous stretches, so that neighbours in an array are neighbours in time. First ordinary
least squares; then generalised least squares, weighted by the residual's colour (`colour`): an autoregression
per channel, the channels' correlation, both free of the bias that fitting brings. The parameters' covariance
is widened, twice as Kenward and Roger have it (Biometrics 53, 1997), by what the colour's own uncertainty
adds; degrees of freedom are Satterthwaite's for whatever combination is asked for. With `ar_order` 0 the
second step is left out.

A kernel estimate (Bartlett, Andrews' plug-in bandwidth) of the scores' long-run covariance takes up what the
colour does not describe, noise that grows with the motion above all: no standard deviation is let below it. A
kernel estimate errs on the small side in short records: its variance is widened by Kiefer and Vogelsang's
critical values (Econometric Theory 21, 2005).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.colour import Colour, colour_of
from impid_host.signals.arrays import Floats
from impid_host.signals.quantiles import student_975

_MAX_CONDITION = 1e7
ROWS_PER_PARAMETER = 3
_ROUNDS = 6
_SETTLED = 1e-3  # of a standard deviation, from one round to the next
_ROUNDING = 1e-7  # a column so much smaller than the largest one is a filter's rounding
_HAUSMAN_SIGMAS = 4.0


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
        covariance_spread: by how much the covariance is uncertain itself: its standard deviations along k
            independent directions, (k, p, p).
        rows: number of rows (instants) used.
        residual_rms: per channel, in the target's unit, before prewhitening.
        relative_error_percent: 100 |target - fit| / |target| over all channels.
        ar_order: order of the residual's autoregression per channel.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    value: Floats
    covariance: Floats
    covariance_spread: Floats
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
        half = self.half_width(np.eye(len(self.value)))
        return np.stack([self.value - half, self.value + half], axis=1)

    @property
    def dof(self) -> float:
        """Degrees of freedom behind the covariance: the median over the parameters."""
        return float(np.median(self._dof(np.eye(len(self.value)))))

    def half_width(self, slope: Floats) -> Floats:
        """Half the 95 % intervals, (k,), of what has derivatives `slope` (k, p) by the parameters."""
        variance = np.einsum("kp,pq,kq->k", slope, self.covariance, slope)
        half: Floats = student_975(self._dof(slope)) * np.sqrt(variance)
        return half

    def _dof(self, slope: Floats) -> Floats:
        """Satterthwaite's, (k,): 2 V^2 / var V."""
        variance = np.einsum("kp,pq,kq->k", slope, self.covariance, slope)
        spread = np.einsum("kp,dpq,kq->dk", slope, self.covariance_spread, slope)
        dof: Floats = np.clip(2 * variance**2 / (np.sum(spread**2, axis=0) + 1e-300), 3.0, 1e6)
        return dof

    def __getitem__(self, name: str) -> float:
        return float(self.value[self.names.index(name)])


@dataclass(frozen=True, slots=True)
class _Solution:
    """Value, covariance and its spread, with the weighted rows that they came from."""

    work: Sequence[Stretch]
    value: Floats
    covariance: Floats
    spread: Floats
    orders: tuple[int, ...]


def enough_rows(stretches: Sequence[Stretch], parameters: int) -> bool:
    """True where there are rows enough, instants times channels, for a fit of so many parameters."""
    return sum(stretch.target.size for stretch in stretches) >= ROWS_PER_PARAMETER * parameters


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
        ar_order: highest order of the residual's autoregression; 0 gives ordinary least squares.
        nuisance_covariance: (k, k) of the parameters behind `Stretch.nuisance`; their uncertainty is
            propagated.

    Raises:
        UndeterminedError: too few rows, or a combination of parameters that the rows do not determine
            (named).
    """
    parameters = len(names)
    rows = sum(len(stretch.target) for stretch in stretches)
    if not enough_rows(stretches, parameters):
        channels = stretches[0].target.shape[1] if stretches else 1
        raise UndeterminedError(
            f"{rows} usable instants of {channels} channels for {parameters} parameters; "
            "longer trials are needed"
        )
    target = np.concatenate([stretch.target for stretch in stretches])
    size = float(np.sqrt(np.mean(target**2)))
    work = [_weighted(stretch, 1 / size if size > 0 else 1.0) for stretch in stretches]
    _require_determined(work, names)
    found = _ordinary(work)
    if ar_order > 0:
        # Channels of unlike noise (a shoulder's torque, a wrist's) count by what each leaves over.
        if work[0].target.shape[1] > 1:
            found = _ordinary([_by_channel(stretch, _noise(work, found.value)) for stretch in work])
        found = _generalised(work, found, ar_order)
    covariance = found.covariance
    if nuisance_covariance is not None:
        gain = _nuisance_gain(found.work)
        covariance = covariance + gain @ nuisance_covariance @ gain.T
    residual = np.concatenate([_residual(stretch, found.value) for stretch in stretches])
    return Estimate(
        names=names,
        units=units,
        value=found.value,
        covariance=covariance,
        covariance_spread=found.spread,
        rows=rows,
        residual_rms=np.sqrt(np.mean(residual**2, axis=0)),
        relative_error_percent=float(
            100 * np.linalg.norm(residual) / max(float(np.linalg.norm(target)), 1e-300)
        ),
        ar_order=found.orders,
    )


def _ordinary(work: Sequence[Stretch]) -> _Solution:
    value, bread = _solve(work)
    covariance, dof = _sandwich(work, value, bread)
    orders = (0,) * work[0].target.shape[1]
    return _Solution(work, value, covariance, np.sqrt(2 / dof) * covariance[None], orders)


def _generalised(stretches: Sequence[Stretch], start: _Solution, ar_order: int) -> _Solution:
    """Weighted by the residual's colour, which is found anew from each solution until both stand still.

    Where that moves a parameter by more than four standard deviations, noisy regressors or a model that lacks
    something are the likely reason (Hausman's test): the start stands.
    """
    value, bread = start.value, _solve(stretches)[1]
    residual = np.concatenate([_residual(stretch, value) for stretch in stretches])
    covariance = bread * float(np.sum(residual**2)) / max(residual.size - len(value), 1)
    blocks = [_block(stretch) for stretch in stretches]
    for _ in range(_ROUNDS):
        root = np.linalg.cholesky(_regular(covariance))
        parts = [
            np.concatenate([_residual(s, value)[:, :, None], s.design @ root], axis=2) for s in stretches
        ]
        colour = colour_of(parts, ar_order)
        before, work = value, _unblocked(colour.whitened(blocks), len(value))
        value, covariance = _solve(work)
        if np.all(np.abs(value - before) < _SETTLED * np.sqrt(np.diag(covariance))):
            break
    if np.any(np.abs(value - start.value) >= _HAUSMAN_SIGMAS * np.sqrt(np.diag(start.covariance))):
        return start
    added, spread = _of_the_colour(blocks, colour, len(value))
    kernel = _sandwich(work, value, covariance)[0]
    return _Solution(work, value, *_not_below(covariance + 2 * added, spread, kernel), colour.orders)


def _of_the_colour(blocks: Sequence[Floats], colour: Colour, parameters: int) -> tuple[Floats, Floats]:
    """What the colour's uncertainty adds to the covariance, (p, p), and how it blurs it, (k, p, p)."""
    moved, spread = [], []
    for up, down in colour.neighbours([block[:, :, : parameters + 1] for block in blocks]):
        above, below = _solve(_unblocked(up, parameters)), _solve(_unblocked(down, parameters))
        moved.append(0.5 * (above[0] - below[0]))
        spread.append(0.5 * (above[1] - below[1]))
    moves = np.array(moved)
    return moves.T @ moves, np.array(spread)


def _block(stretch: Stretch) -> Floats:
    """Design, target and nuisance beside each other, (N, c, p + 1 + k)."""
    parts = [stretch.design, stretch.target[:, :, None]]
    return np.concatenate(parts if stretch.nuisance is None else [*parts, stretch.nuisance], axis=2)


def _unblocked(blocks: Sequence[Floats], p: int) -> list[Stretch]:
    return [
        Stretch(block[:, :, :p], block[:, :, p], block[:, :, p + 1 :] if block.shape[2] > p + 1 else None)
        for block in blocks
    ]


def _residual(stretch: Stretch, value: Floats) -> Floats:
    result: Floats = stretch.target - stretch.design @ value
    return result


def _weighted(stretch: Stretch, weight: float) -> Stretch:
    nuisance = None if stretch.nuisance is None else stretch.nuisance * weight
    return Stretch(stretch.design * weight, stretch.target * weight, nuisance)


def _noise(work: Sequence[Stretch], value: Floats) -> Floats:
    """rms residual per channel over their mean, (c,)."""
    residual = np.concatenate([_residual(stretch, value) for stretch in work])
    rms = np.sqrt(np.mean(residual**2, axis=0))
    result: Floats = np.maximum(rms, _ROUNDING * rms.max() + 1e-300) / max(float(rms.mean()), 1e-300)
    return result


def _by_channel(stretch: Stretch, size: Floats) -> Stretch:
    nuisance = None if stretch.nuisance is None else stretch.nuisance / size[:, None]
    return Stretch(stretch.design / size[:, None], stretch.target / size, nuisance)


def _normal(work: Sequence[Stretch]) -> Floats:
    flat = [stretch.design.reshape(-1, stretch.design.shape[2]) for stretch in work]
    total: Floats = np.asarray(sum(X.T @ X for X in flat), dtype=np.float64)
    return total


def _solve(work: Sequence[Stretch]) -> tuple[Floats, Floats]:
    """Value (p,), and its covariance (p, p) if rows have unit variance and no correlation."""
    moment = sum(s.design.reshape(-1, s.design.shape[2]).T @ s.target.ravel() for s in work)
    normal = _normal(work)
    size = np.sqrt(np.diag(normal))
    inverse = np.linalg.inv(normal / np.outer(size, size))
    value: Floats = inverse @ (moment / size) / size
    return value, np.asarray(inverse / np.outer(size, size), dtype=np.float64)


def _regular(covariance: Floats) -> Floats:
    """A covariance that rounding may have left indefinite, made safe for Cholesky."""
    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    symmetric = 0.5 * (covariance + covariance.T) / np.outer(size, size)
    result: Floats = (symmetric + 1e-10 * np.eye(len(size))) * np.outer(size, size)
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


def _nuisance_gain(work: Sequence[Stretch]) -> Floats:
    """d value / d nuisance parameters, (p, k)."""
    cross = sum(np.einsum("kcp,kcq->pq", s.design, s.nuisance) for s in work if s.nuisance is not None)
    result: Floats = np.linalg.solve(_normal(work), cross)
    return result


def _sandwich(work: Sequence[Stretch], value: Floats, bread: Floats) -> tuple[Floats, float]:
    """Covariance by the kernel estimate, (p, p), and its degrees of freedom."""
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
    dof = max(1.5 * rows / max(bandwidth, 1.0) - parameters, 3.0)
    return bread @ meat @ bread * correction, dof


def _not_below(covariance: Floats, spread: Floats, floor: Floats) -> tuple[Floats, Floats]:
    """Covariance, its standard deviations raised to those of `floor`, correlations kept; its spread alike."""
    raised = np.sqrt(np.maximum(np.diag(floor) / np.maximum(np.diag(covariance), 1e-300), 1.0))
    factor = np.outer(raised, raised)
    return np.asarray(covariance * factor, dtype=np.float64), np.asarray(spread * factor, dtype=np.float64)


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
