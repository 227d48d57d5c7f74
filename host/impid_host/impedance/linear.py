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

Where rows carry instruments Z beside their design X, the same is done with Z' (y - X value) = 0 in place of
X' (y - X value) = 0, weighted alike, sandwich and nuisance through Z (Soderstrom and Stoica, Instrumental
Variable Methods for System Identification, 1983). Noise in X that has nothing to do with Z then does no harm.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.colour import Colour, colour_of
from impid_host.impedance.kernel import long_run_covariance
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
        instruments: (N, c, p), what the design would be without noise, or near it; None: the design itself.
    """

    design: Floats
    target: Floats
    nuisance: Floats | None = None
    instruments: Floats | None = None

    @property
    def left(self) -> Floats:
        """What multiplies the rows from the left in the normal equations, (N, c, p)."""
        return self.design if self.instruments is None else self.instruments


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
        least_squares: where instruments were used, by how much least squares on the same weighted rows
            differ, and that shift's standard deviation, (2, p).
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
    least_squares: Floats | None = None

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
    weight = np.full(target.shape[1], 1 / size if size > 0 else 1.0)
    work = [_scaled(stretch, weight) for stretch in stretches]
    _require_determined(work, names)
    found = _ordinary(work)
    if ar_order > 0:
        # Channels of unlike noise (a shoulder's torque, a wrist's) count by what each leaves over.
        if work[0].target.shape[1] > 1:
            weight = 1 / _noise(work, found.value)
            found = _ordinary([_scaled(stretch, weight) for stretch in work])
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
        least_squares=None if stretches[0].instruments is None else _against_least_squares(found.work),
    )


def _ordinary(work: Sequence[Stretch]) -> _Solution:
    solved = _solve(work)
    covariance, dof = _sandwich(work, solved)
    orders = (0,) * work[0].target.shape[1]
    return _Solution(work, solved.value, covariance, np.sqrt(2 / dof) * covariance[None], orders)


def _generalised(stretches: Sequence[Stretch], start: _Solution, ar_order: int) -> _Solution:
    """Weighted by the residual's colour, which is found anew from each solution until both stand still.

    Where that moves a parameter by more than four standard deviations, noisy regressors or a model that lacks
    something are the likely reason (Hausman's test): the start stands.
    """
    value, white = start.value, _solve(stretches).covariance
    residual = np.concatenate([_residual(stretch, value) for stretch in stretches])
    covariance = white * float(np.sum(residual**2)) / max(residual.size - len(value), 1)
    blocks = [_block(stretch) for stretch in stretches]
    for _ in range(_ROUNDS):
        root = np.linalg.cholesky(_regular(covariance))
        parts = [
            np.concatenate([_residual(s, value)[:, :, None], s.design @ root], axis=2) for s in stretches
        ]
        colour = colour_of(parts, ar_order)
        before, work = value, _unblocked(colour.whitened(blocks), stretches[0])
        solved = _solve(work)
        value, covariance = solved.value, solved.covariance
        if np.all(np.abs(value - before) < _SETTLED * np.sqrt(np.diag(covariance))):
            break
    if np.any(np.abs(value - start.value) >= _HAUSMAN_SIGMAS * np.sqrt(np.diag(start.covariance))):
        return start
    added, spread = _of_the_colour(blocks, colour, stretches[0])
    kernel = _sandwich(work, solved)[0]
    return _Solution(work, value, *_not_below(covariance + 2 * added, spread, kernel), colour.orders)


def _of_the_colour(blocks: Sequence[Floats], colour: Colour, like: Stretch) -> tuple[Floats, Floats]:
    """What the colour's uncertainty adds to the covariance, (p, p), and how it blurs it, (k, p, p)."""
    moved, spread = [], []
    known = _block(replace(like, nuisance=None)).shape[2]
    for up, down in colour.neighbours([block[:, :, :known] for block in blocks]):
        above, below = _solve(_unblocked(up, like)), _solve(_unblocked(down, like))
        moved.append(0.5 * (above.value - below.value))
        spread.append(0.5 * (above.covariance - below.covariance))
    moves = np.array(moved)
    return moves.T @ moves, np.array(spread)


def _block(stretch: Stretch) -> Floats:
    """Design, target, instruments and nuisance beside each other, (N, c, p + 1 + p + k)."""
    parts = [stretch.design, stretch.target[:, :, None], stretch.instruments, stretch.nuisance]
    return np.concatenate([part for part in parts if part is not None], axis=2)


def _unblocked(blocks: Sequence[Floats], like: Stretch) -> list[Stretch]:
    """The stretches behind blocks that are laid out as that of `like`."""
    p = like.design.shape[2]
    end = p + 1 if like.instruments is None else 2 * p + 1
    return [
        Stretch(
            block[:, :, :p],
            block[:, :, p],
            block[:, :, end:] if block.shape[2] > end else None,
            block[:, :, p + 1 : end] if end > p + 1 else None,
        )
        for block in blocks
    ]


def _residual(stretch: Stretch, value: Floats) -> Floats:
    result: Floats = stretch.target - stretch.design @ value
    return result


def _scaled(stretch: Stretch, weight: Floats) -> Stretch:
    """Each channel times its weight, (c,)."""
    return Stretch(
        stretch.design * weight[:, None],
        stretch.target * weight,
        None if stretch.nuisance is None else stretch.nuisance * weight[:, None],
        None if stretch.instruments is None else stretch.instruments * weight[:, None],
    )


def _noise(work: Sequence[Stretch], value: Floats) -> Floats:
    """rms residual per channel over their mean, (c,)."""
    residual = np.concatenate([_residual(stretch, value) for stretch in work])
    rms = np.sqrt(np.mean(residual**2, axis=0))
    result: Floats = np.maximum(rms, _ROUNDING * rms.max() + 1e-300) / max(float(rms.mean()), 1e-300)
    return result


def _normal(work: Sequence[Stretch]) -> Floats:
    flat = [stretch.design.reshape(-1, stretch.design.shape[2]) for stretch in work]
    total: Floats = np.asarray(sum(X.T @ X for X in flat), dtype=np.float64)
    return total


@dataclass(frozen=True, slots=True)
class _Solved:
    """Value (p,), inverse of Z' X (p, p), and the covariance (p, p) if rows are white with unit variance."""

    value: Floats
    inverse: Floats
    covariance: Floats


def _solve(work: Sequence[Stretch]) -> _Solved:
    moment = sum(s.left.reshape(-1, s.left.shape[2]).T @ s.target.ravel() for s in work)
    size = np.sqrt(np.diag(_normal(work)))
    if work[0].instruments is None:
        scaled = np.linalg.inv(_normal(work) / np.outer(size, size))
        inverse = np.asarray(scaled / np.outer(size, size), dtype=np.float64)
        return _Solved(scaled @ (moment / size) / size, inverse, inverse)
    squares = sum(s.left.reshape(-1, len(size)).T @ s.left.reshape(-1, len(size)) for s in work)
    width = np.sqrt(np.diag(squares))
    scaled = np.linalg.inv(_shared(work) / np.outer(width, size))
    inverse = np.asarray(scaled / np.outer(size, width), dtype=np.float64)
    return _Solved(scaled @ (moment / width) / size, inverse, inverse @ squares @ inverse.T)


def _shared(work: Sequence[Stretch]) -> Floats:
    """Z' X, (p, p)."""
    flat = [(s.left.reshape(-1, s.left.shape[2]), s.design.reshape(-1, s.design.shape[2])) for s in work]
    total: Floats = np.asarray(sum(Z.T @ X for Z, X in flat), dtype=np.float64)
    return total


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
    cross = sum(np.einsum("kcp,kcq->pq", s.left, s.nuisance) for s in work if s.nuisance is not None)
    result: Floats = np.linalg.solve(_shared(work), cross)
    return result


def _sandwich(work: Sequence[Stretch], solved: _Solved) -> tuple[Floats, float]:
    """Covariance by the kernel estimate, (p, p), and its degrees of freedom."""
    value, bread = solved.value, solved.inverse
    scores = [np.einsum("kcp,kc->kp", s.left, _residual(s, value)) for s in work]
    rows, parameters = sum(len(s) for s in scores), len(value)
    meat, bandwidth = long_run_covariance(scores)
    channels = work[0].target.shape[1]
    # 1.96 + 2.9694 b is the 97.5 % point when the bandwidth is a share b of the rows.
    widening = (1 + 2.9694 * bandwidth / rows / 1.96) ** 2
    correction = widening * rows * channels / max(rows * channels - parameters, 1)
    dof = max(1.5 * rows / max(bandwidth, 1.0) - parameters, 3.0)
    return bread @ meat @ bread.T * correction, dof


def _against_least_squares(work: Sequence[Stretch]) -> Floats:
    """What least squares make of the rows, less what the instruments make, and its sd, (2, p)."""
    by_instruments = _solve(work)
    plain = _solve([replace(stretch, instruments=None) for stretch in work])
    apart = [
        replace(s, instruments=s.design @ plain.inverse.T - s.left @ by_instruments.inverse.T) for s in work
    ]
    p = len(plain.value)
    # The difference is this combination of the residuals, whatever they are.
    covariance = _sandwich(apart, replace(by_instruments, inverse=np.eye(p)))[0]
    return np.stack([plain.value - by_instruments.value, np.sqrt(np.diag(covariance))])


def _not_below(covariance: Floats, spread: Floats, floor: Floats) -> tuple[Floats, Floats]:
    """Covariance, its standard deviations raised to those of `floor`, correlations kept; its spread alike."""
    raised = np.sqrt(np.maximum(np.diag(floor) / np.maximum(np.diag(covariance), 1e-300), 1.0))
    factor = np.outer(raised, raised)
    return np.asarray(covariance * factor, dtype=np.float64), np.asarray(spread * factor, dtype=np.float64)
