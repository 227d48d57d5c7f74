"""The noise of each channel: an autoregression, and how heavy the tails of its power are from block to block.

Both are fitted on what a rich regression leaves of the fit part: the base model, every effect of the
catalogue at a few shapes and the unnamed structures. They stay the same for all explanations that are
compared.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg, special

from impid_host.diagnosis.rows import Index, Key, Run, mapped
from impid_host.signals.arrays import Floats
from impid_host.signals.filters import FiniteResponse

_HIGHEST_ORDER = 12
BLOCK_S = 2.0
TAILS = (3.0, 10.0, 30.0, 100.0, 1e4)  # degrees of freedom that are tried; the last is Gaussian

Taps = Mapping[Key, Floats]


@dataclass(frozen=True, slots=True)
class Noise:
    """Whitening taps by channel, (order + 1,); tails: degrees of freedom of a block's power, by channel."""

    taps: Taps
    tails: Mapping[Key, float]


@dataclass(frozen=True, slots=True)
class Rich:
    """A regression rich enough to leave nothing but noise.

    Attributes:
        columns: of terms, beside the base model; together: trials of one set have the same coefficients.
    """

    columns: Index
    together: tuple[frozenset[str], ...]


def noise_models(runs: Sequence[Run], tried: Sequence[Rich]) -> Taps:
    """Whitening taps per channel from what is left by the best of several rich regressions, by AICc.

    Where an effect is in some trials only, one set of coefficients for all leaves it in the noise; where it
    is in all, more sets take noise for signal.
    """
    taps: dict[Key, Floats] = {}
    for key in sorted({run.key for run in runs}):
        own = [run for run in runs if run.key == key]
        target = np.concatenate([run.target for run in own])
        if target.any():
            left = min((_left(own, rich) for rich in tried), key=lambda found: found.aicc)
            residual = left.residual * np.sqrt(left.spare)
        else:
            # A joint without a drive: any parameters of zero fit it, and what it lacks is told by the others.
            residual = _by_all(runs, own)
        cuts = np.cumsum([len(run.target) for run in own])[:-1]
        taps[key] = autoregression(np.split(residual, cuts))
    return taps


@dataclass(frozen=True, slots=True)
class _Left:
    """What a rich regression leaves of a channel, (N,).

    Attributes:
        spare: number of rows over those that its parameters leave free.
    """

    residual: Floats
    spare: float
    aicc: float


def _left(runs: Sequence[Run], rich: Rich) -> _Left:
    wanted = rich.columns[np.isin(rich.columns, np.concatenate([run.used for run in runs]))]
    parts: dict[int, Floats] = {}
    width = 0
    for names in rich.together:
        own = [k for k, run in enumerate(runs) if run.trial in names]
        if not own:
            continue
        some = [runs[k] for k in own]
        residual, more = _left_by(some, wanted, np.concatenate([run.target for run in some]))
        width += more
        cuts = np.cumsum([len(run.target) for run in some])[:-1]
        parts |= dict(zip(own, np.split(residual, cuts), strict=True))
    residual = np.concatenate([parts[k] for k in range(len(runs))])
    count = len(residual)
    variance = max(float(residual @ residual) / count, 1e-300)
    aicc = count * np.log(variance) + 2.0 * (width + 1) * count / max(count - width - 2, 1)
    # Columns that take more than they leave take slow noise whole.
    spare = count / (count - min(width, count // 2))
    return _Left(residual, spare, aicc if 2 * width < count else np.inf)


def _left_by(runs: Sequence[Run], wanted: Index, target: Floats) -> tuple[Floats, int]:
    """What base and the wanted columns leave of the runs' target, (N,), and how many of them are not zero.

    Triangle by triangle (QR), one run after another: the columns of all runs never stand side by side.
    """

    def design(run: Run) -> Floats:
        return np.column_stack([run.base, run.columns(wanted)])

    cuts = np.cumsum([len(run.target) for run in runs])[:-1]
    triangle = np.zeros((0, runs[0].base.shape[1] + len(wanted) + 1))
    for run, own in zip(runs, np.split(target, cuts), strict=True):
        rows = np.concatenate([triangle, np.column_stack([design(run), own])])
        triangle = np.asarray(np.linalg.qr(rows, mode="r"), dtype=np.float64)
    size = np.linalg.norm(triangle[:, :-1], axis=0)
    alive = size > 0
    scaled = triangle[:, :-1][:, alive] / size[alive]
    beta = np.zeros(len(size))
    beta[alive] = np.linalg.lstsq(scaled, triangle[:, -1], rcond=1e-8)[0] / size[alive]
    return target - np.concatenate([design(run) @ beta for run in runs]), int(alive.sum())


def _by_all(runs: Sequence[Run], own: Sequence[Run]) -> Floats:
    """What the base model, fitted to all channels together, leaves of some of them, (N,)."""
    base = np.concatenate([run.base for run in runs])
    target = np.concatenate([run.target for run in runs])
    size = np.linalg.norm(base, axis=0) + 1e-300
    value = np.linalg.lstsq(base / size, target, rcond=1e-10)[0] / size
    return np.concatenate([run.target - run.base @ value for run in own])


def whitened(runs: Sequence[Run], taps: Taps) -> list[Run]:
    """Rows turned into innovations of unit variance; each run loses as many rows as its channel has taps."""

    responses = {key: FiniteResponse.of(own) for key, own in taps.items()}
    return mapped(runs, lambda run, Z: responses[run.key].apply(Z))


def autoregression(residuals: Sequence[Floats]) -> Floats:
    """AR by Yule-Walker, order by AICc; taps over the innovation's standard deviation."""
    count = sum(len(r) for r in residuals)
    highest = max(0, min(_HIGHEST_ORDER, count // 25, min(len(r) for r in residuals) // 4))
    lags = np.array(
        [sum(float(r[lag:] @ r[: len(r) - lag]) for r in residuals) / count for lag in range(highest + 1)]
    )
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


def log_density(squares: Floats, rows: Floats, tail: Floats) -> Floats:
    """Of blocks of `rows` innovations whose squares sum to `squares`, all (U,), nats.

    A multivariate t of `tail` degrees of freedom: the power of the noise changes from block to block, so that
    a push in one of them neither makes nor breaks an explanation.
    """
    half = 0.5 * (tail + rows)
    level = special.gammaln(half) - special.gammaln(0.5 * tail) - 0.5 * rows * np.log(np.pi * tail)
    result: Floats = level - half * np.log1p(squares / tail)
    return result


def tail_of(squares: Floats, rows: Floats) -> float:
    """Degrees of freedom under which a channel's blocks are most likely."""
    return max(TAILS, key=lambda tail: float(np.sum(log_density(squares, rows, np.full(len(rows), tail)))))
