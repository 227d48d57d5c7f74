"""What rows can show when they do not determine every parameter: the combinations that they do (QR).

With the design's columns split into independent ones W1 and the rest W2 = W1 X, the rows show p1 + X p2 and
say nothing of p2 alone. Reported are those combinations, by name; no number is made up for the parts.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.linear import Stretch
from impid_host.signals.arrays import Floats

# Columns nearer to each other than this are the same to the regression, whose condition limit is 1e7.
_TOLERANCE = 1e-6
_NEGLIGIBLE = 1e-4
_LOST_IN_NOISE = 1e-2


@dataclass(frozen=True, slots=True)
class Combinations:
    """The r combinations that the rows determine, of p parameters.

    Attributes:
        kept: columns that carry them, (r,).
        labels: of the combinations, r.
        unseen: directions in parameter space that move nothing in these rows, (p, p - r).
    """

    kept: tuple[int, ...]
    labels: tuple[str, ...]
    unseen: Floats

    def cut(self, stretch: Stretch) -> Stretch:
        """The stretch with the kept columns alone."""
        kept = list(self.kept)
        instruments = None if stretch.instruments is None else stretch.instruments[:, :, kept]
        return Stretch(stretch.design[:, :, kept], stretch.target, stretch.nuisance, instruments)


def combinations(stretches: Sequence[Stretch], names: Sequence[str]) -> Combinations:
    """Find them; earlier parameters are kept in preference.

    Raises:
        UndeterminedError: the rows show nothing at all.
    """
    from scipy import linalg  # noqa: PLC0415  (a tenth of a second, which starting can do without)

    W = np.concatenate([stretch.design.reshape(-1, len(names)) for stretch in stretches])
    size = np.linalg.norm(W, axis=0)
    alive = np.flatnonzero(size > _TOLERANCE * size.max()) if size.max() > 0 else np.zeros(0, dtype=int)
    if len(alive) == 0:
        raise UndeterminedError("nothing moves in these trials")
    R = linalg.qr(W[:, alive] / size[alive], mode="r")[0]
    independent = np.zeros(len(alive), dtype=bool)
    steps = np.abs(np.diag(R))  # fewer than columns where there are fewer rows
    independent[: len(steps)] = steps > _TOLERANCE
    kept = alive[independent]
    rest = np.setdiff1d(np.arange(len(names)), kept)
    # A column that is nothing but rounding belongs to no combination.
    moving = np.where(np.isin(rest, alive), 1.0, 0.0)
    scaled = np.linalg.lstsq(W[:, kept] / size[kept], W[:, rest] * moving, rcond=None)[0]
    strength = np.abs(scaled) / np.maximum(size[rest], 1e-300)
    return _built(names, kept, rest, scaled / size[kept][:, None], strength > _NEGLIGIBLE)


def combinations_left(
    directions: Floats, stretches: Sequence[Stretch], size: Floats, names: Sequence[str]
) -> Combinations:
    """The combinations left when the rows say nothing trustworthy along `directions` (p, k).

    Args:
        stretches: rows in which those directions are quietest; they say how columns hang together.
        size: of each parameter's column in the rows that will be fitted, (p,).

    Raises:
        UndeterminedError: nothing is left.
    """
    from scipy import linalg  # noqa: PLC0415  (a tenth of a second, which starting can do without)

    size = np.maximum(size, _TOLERANCE * size.max())
    order = linalg.qr((directions * size[:, None]).T, mode="r", pivoting=True)[1]
    rest = np.sort(order[: directions.shape[1]])
    kept = np.setdiff1d(np.arange(len(names)), rest)
    if len(kept) == 0:
        raise UndeterminedError("nothing moves above the accelerometer's noise in these trials")
    W = np.concatenate([stretch.design.reshape(-1, len(names)) for stretch in stretches])
    scaled = np.linalg.lstsq(W[:, kept] / size[kept], W[:, rest] / size[rest], rcond=None)[0]
    X = scaled * size[rest] / size[kept][:, None]
    return _built(names, kept, rest, X, np.abs(scaled) > _LOST_IN_NOISE)


def _built(
    names: Sequence[str], kept: np.ndarray, rest: np.ndarray, X: Floats, present: np.ndarray
) -> Combinations:
    """p_kept + X p_rest, of which only what is `present` (r, p - r) is named."""
    X = np.where(present, X, 0.0)
    unseen = np.zeros((len(names), len(rest)))
    unseen[kept] = -X
    unseen[rest] = np.eye(len(rest))
    labels = tuple(_label(names, int(column), X[row], rest) for row, column in enumerate(kept))
    return Combinations(tuple(int(c) for c in kept), labels, unseen)


def needs_unseen(slope: Floats, unseen: Floats) -> bool:
    """True where rows with regressor `slope` (N, c, p) feel the unseen directions (p, k)."""
    reach = np.sqrt(np.mean((slope @ unseen) ** 2, axis=(0, 1)))
    whole = np.sqrt(np.mean(slope**2, axis=(0, 1))) @ np.abs(unseen)
    return bool(np.any(reach > _NEGLIGIBLE * np.maximum(whole, 1e-300)))


def _label(names: Sequence[str], column: int, X: Floats, rest: np.ndarray) -> str:
    terms = [
        f"{'+' if factor > 0 else '-'} {_times(abs(factor))}{names[other]}"
        for factor, other in zip(X, rest, strict=True)
        if factor != 0
    ]
    return " ".join([names[column], *terms])


def _times(factor: float) -> str:
    shown = f"{factor:.4g}"
    return "" if shown == "1" else f"{shown}*"
