"""Which curves the data ask for: evidence, hyper-parameters, posterior of a linear model with smooth curves.

target = design @ [beta, u] + noise of unit variance times s^2, where beta (q,) are constants with a flat
prior and u the curves' values at their knots. Constants and s are integrated out (restricted likelihood), so
all that depends on the hyper-parameters is a factorisation of the size of u; rows enter once, by their normal
equations.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import linalg, optimize

from impid_host.impedance.linear import Stretch
from impid_host.impedance.varying.curves import Knots
from impid_host.signals.arrays import Floats

# Hyper-parameters in logarithms: an amplitude is rarely above the scale that a group has, a length mostly a
# tenth of the span to all of it.
_LENGTH_CENTRE, _LENGTH_SPREAD = np.log(0.3), 0.7
LEAST_AMPLITUDE = 1e-3
_LONGEST = 3.0
_STEPS, _BURN, _THIN = 700, 250, 5


@dataclass(frozen=True, slots=True)
class Group:
    """Constants that vary alike: entries of one matrix.

    Attributes:
        name: "K", "B" or "x0"; columns: of the load's parameters; scale: a variation that would be large, in
            their unit.
    """

    name: str
    columns: tuple[int, ...]
    scale: float


@dataclass(frozen=True, slots=True)
class Layout:
    """Where everything stands: q constants, then for each group, for each of its columns, m knots."""

    constants: int
    groups: tuple[Group, ...]
    knots: Knots

    @property
    def size(self) -> int:
        """Of the whole parameter vector."""
        return self.constants + self.knots.count * sum(len(group.columns) for group in self.groups)

    def slices(self) -> list[slice]:
        """Of each group within u."""
        ends = np.cumsum([0] + [self.knots.count * len(group.columns) for group in self.groups])
        return [slice(int(a), int(b)) for a, b in pairwise(ends)]

    def columns_of(self, column: int) -> list[int]:
        """Where one of the constants stands, and after it the knots of its curve, if it has one."""
        for group, part in zip(self.groups, self.slices(), strict=True):
            if column in group.columns:
                first = self.constants + part.start + self.knots.count * group.columns.index(column)
                return [column, *range(first, first + self.knots.count)]
        return [column]

    def curve(self, column: int, s: Floats) -> Floats:
        """Slope (N, size) of the value of one of the constants at places s by all parameters."""
        slope = np.zeros((len(s), self.size))
        constant, *knots = self.columns_of(column)
        slope[:, constant] = 1.0
        if knots:
            slope[:, knots] = self.knots.weights(s)
        return slope


@dataclass(frozen=True, slots=True)
class Normal:
    """Normal equations of whitened rows.

    Attributes:
        G: (p, p); g: (p,); yy: sum of squares; rows: their number; N: (p, k) against nuisance columns, or
            None.
    """

    G: Floats
    g: Floats
    yy: float
    rows: int
    N: Floats | None = None

    @staticmethod
    def of(work: Sequence[Stretch]) -> "Normal":
        """From whitened stretches."""
        p = work[0].design.shape[2]
        flat = [(s.design.reshape(-1, p), s.target.ravel()) for s in work]
        N = None
        if work[0].nuisance is not None:
            N = np.sum([X.T @ s.nuisance.reshape(len(X), -1) for (X, _), s in zip(flat, work, strict=True)
                        if s.nuisance is not None], axis=0)  # fmt: skip
        return Normal(
            np.sum([X.T @ X for X, _ in flat], axis=0),
            np.sum([X.T @ y for X, y in flat], axis=0),
            float(sum(y @ y for _, y in flat)),
            sum(len(y) for _, y in flat),
            N,
        )

    def without(self, other: "Normal") -> "Normal":
        """The rest when some of the rows are left out."""
        return Normal(self.G - other.G, self.g - other.g, self.yy - other.yy, self.rows - other.rows)


@dataclass(frozen=True, slots=True)
class Posterior:
    """Parameters given hyper-parameters: N(mean, s^2 root root'); s^2 has `dof` degrees of freedom."""

    mean: Floats
    root: Floats
    variance: float
    dof: float


@dataclass(frozen=True, slots=True)
class Parts:
    """At some hyper-parameters: roots of each curve's prior, the factor of 1 + T' G T (T of all roots), what
    it leaves of T' g, and of the sum of squares.
    """

    roots: tuple[Floats, ...]
    factor: Floats
    half: Floats
    left: float

    def through(self, values: Floats) -> Floats:
        """T @ values, (p_u, k)."""
        m = len(self.roots[0])
        return np.concatenate([root @ values[m * k : m * (k + 1)] for k, root in enumerate(self.roots)])

    def back(self, values: Floats) -> Floats:
        """factor^-1 T' @ values, (p_u, k)."""
        m = len(self.roots[0])
        turned = np.concatenate([root.T @ values[m * k : m * (k + 1)] for k, root in enumerate(self.roots)])
        result: Floats = linalg.solve_triangular(self.factor, turned, lower=True)
        return result


class Evidence:
    """Restricted likelihood of the hyper-parameters (log amplitude over scale, log length) of each group."""

    def __init__(self, normal: Normal, layout: Layout) -> None:
        q = layout.constants
        G, g = normal.G, normal.g
        self.layout, self.normal = layout, normal
        self._fixed = linalg.cho_factor(_regular(G[:q, :q]), lower=False)
        self._cross = linalg.cho_solve(self._fixed, G[:q, q:])
        self._beta = linalg.cho_solve(self._fixed, g[:q])
        self.G = G[q:, q:] - G[:q, q:].T @ self._cross
        self.g = g[q:] - G[:q, q:].T @ self._beta
        self.rss = max(normal.yy - float(g[:q] @ self._beta), 1e-300)
        self.dof = float(normal.rows - q)

    def nuisance(self) -> Floats:
        """The curves' rows against nuisance columns, constants taken out, (p_u, k)."""
        assert self.normal.N is not None
        q = self.layout.constants
        result: Floats = self.normal.N[q:] - self._cross.T @ self.normal.N[:q]
        return result

    def roots(self, hyper: Floats) -> list[Floats]:
        """Amplitude times L (m, m) for each curve in turn: u = root @ v, v ~ N(0, 1)."""
        layout, roots = self.layout, []
        for k, group in enumerate(layout.groups):
            amplitude = group.scale * np.exp(hyper[2 * k])
            root = np.zeros((layout.knots.count,) * 2)
            if amplitude > 0:
                root = amplitude * layout.knots.root(float(np.exp(hyper[2 * k + 1])))
            roots += [root] * len(group.columns)
        return roots

    def parts(self, hyper: Floats) -> "Parts":
        """The factorisation behind everything, block by block."""
        roots, m = self.roots(hyper), self.layout.knots.count
        blocks = [slice(m * k, m * (k + 1)) for k in range(len(roots))]
        inner = np.empty_like(self.G)
        for block, root in zip(blocks, roots, strict=True):
            inner[block] = root.T @ self.G[block]
        for block, root in zip(blocks, roots, strict=True):
            inner[:, block] = inner[:, block] @ root
        inner.flat[:: len(inner) + 1] += 1.0
        factor = linalg.cholesky(inner, lower=True, check_finite=False, overwrite_a=True)
        turned = np.concatenate([root.T @ self.g[block] for block, root in zip(blocks, roots, strict=True)])
        half = linalg.solve_triangular(factor, turned, lower=True, check_finite=False)
        return Parts(tuple(roots), factor, half, max(self.rss - float(half @ half), 1e-300))

    def log_likelihood(self, hyper: Floats) -> float:
        """Up to a constant; that of no curves at all is -dof/2 log rss."""
        parts = self.parts(hyper)
        return float(-np.sum(np.log(np.diag(parts.factor))) - 0.5 * self.dof * np.log(parts.left))

    def of_constants(self) -> float:
        """What the constants add to the restricted likelihood; it depends on how rows are whitened alone."""
        return -float(np.sum(np.log(np.diag(self._fixed[0]))))

    def log_posterior(self, hyper: Floats) -> float:
        """With the prior: exponential in amplitude, log-normal in length."""
        amplitude, length = hyper[0::2], hyper[1::2]
        shortest = np.log(self.layout.knots.shortest)
        if np.any((amplitude < np.log(LEAST_AMPLITUDE)) | (length < shortest) | (length > np.log(_LONGEST))):
            return -np.inf
        prior = np.sum(amplitude - 2.0 * np.exp(amplitude))
        prior -= np.sum((length - _LENGTH_CENTRE) ** 2) / (2 * _LENGTH_SPREAD**2)
        return self.log_likelihood(hyper) + float(prior)

    def mode(self, absent: Sequence[int] = (), near: Floats | None = None) -> Floats:
        """The most likely hyper-parameters, groups in `absent` without any curve; `near` is a start."""
        count = len(self.layout.groups)
        free = [k for k in range(count) if k not in absent]
        whole = np.zeros(2 * count)
        whole[1::2] = _LENGTH_CENTRE
        whole[0::2] = -np.inf

        if not free:
            return whole
        places = np.array([[2 * k, 2 * k + 1] for k in free]).ravel()
        bounds = [(np.log(LEAST_AMPLITUDE), 2.0), (np.log(self.layout.knots.shortest), np.log(_LONGEST))]

        def cost(values: Floats) -> float:
            hyper = whole.copy()
            hyper[places] = values
            amplitude, length = values[0::2], values[1::2]
            prior = np.sum(amplitude - 2.0 * np.exp(amplitude))
            prior -= np.sum((length - _LENGTH_CENTRE) ** 2) / (2 * _LENGTH_SPREAD**2)
            return -self.log_likelihood(hyper) - float(prior)

        start = np.tile([np.log(0.2), np.log(0.3)], len(free)) if near is None else near[places]
        found = optimize.minimize(cost, start, method="L-BFGS-B", bounds=bounds * len(free),
                                  options={"maxiter": 40, "ftol": 1e-7})  # fmt: skip
        whole[places] = found.x
        return whole

    def posterior(self, hyper: Floats) -> Posterior:
        """All parameters, constants first."""
        parts, q = self.parts(hyper), self.layout.constants
        u_root = parts.through(linalg.solve_triangular(parts.factor.T, np.eye(len(parts.half)), lower=False))
        fixed_root = linalg.solve_triangular(self._fixed[0], np.eye(q), lower=False)
        root = np.block([[fixed_root, -self._cross @ u_root], [np.zeros((len(u_root), q)), u_root]])
        u = u_root @ parts.half
        mean = np.concatenate([self._beta - self._cross @ u, u])
        return Posterior(mean, root, parts.left / self.dof, self.dof)

    def mean(self, hyper: Floats) -> Floats:
        """The posterior's mean alone, (p,)."""
        parts = self.parts(hyper)
        u = parts.through(linalg.solve_triangular(parts.factor.T, parts.half, lower=False))
        return np.concatenate([self._beta - self._cross @ u, u])

    def sample(self, start: Floats, rng: np.random.Generator) -> Floats:
        """Hyper-parameters from their posterior by an adaptive random walk, (draws, 2 groups)."""
        size = len(start)
        scale = np.full(size, 0.4)
        now, value = start.copy(), self.log_posterior(start)
        factor = np.diag(scale)
        seen: list[Floats] = []
        kept: list[Floats] = []
        for step in range(_STEPS):
            if step in (80, 160, _BURN):
                spread = np.cov(np.array(seen[step // 3 :]).T) + 1e-3 * np.eye(size)
                factor = 2.38 / np.sqrt(size) * np.linalg.cholesky(np.atleast_2d(spread))
            trial = now + factor @ rng.normal(size=size)
            there = self.log_posterior(trial)
            if np.log(rng.uniform()) < there - value:
                now, value = trial, there
            seen.append(now)
            if step >= _BURN and step % _THIN == 0:
                kept.append(now)
        return np.array(kept)


def _regular(G: Floats) -> Floats:
    result: Floats = 0.5 * (G + G.T) + 1e-12 * np.diag(np.diag(G))
    return result
