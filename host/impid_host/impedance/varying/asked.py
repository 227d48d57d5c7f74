"""Whether the data ask for a curve at all: a restricted likelihood ratio with its own null distribution.

Under the null a group is constant, while the other groups may vary as they do when it is. The statistic is
the largest gain in restricted likelihood over lengths and amplitudes; as amplitude zero lies on the boundary,
its distribution is no chi square: it is drawn from the scores' own covariance (Crainiceanu and Ruppert, J. R.
Statist. Soc. B 66, 2004).
"""

from dataclasses import dataclass

import numpy as np

from impid_host.impedance.varying.posterior import Evidence
from impid_host.signals.arrays import Floats

_DRAWS = 20_000
_LENGTHS = (0.1, 0.2, 0.4, 0.8, 2.0)
_AMPLITUDES = tuple(float(a) for a in np.geomspace(0.003, 3.0, 12))


@dataclass(frozen=True, slots=True)
class Asked:
    """Of one group: twice the gain in log likelihood, and the probability of so much where it is constant."""

    group: str
    gain: float
    p_value: float


def asked(
    evidence: Evidence,
    group: int,
    near: Floats,
    rng: np.random.Generator,
    nuisance_covariance: Floats | None = None,
) -> Asked:
    """Is the group's curve asked for, the others free to vary?

    Args:
        near: hyper-parameters to start from.
        nuisance_covariance: (k, k) of the parameters behind the rows' nuisance columns.
    """
    layout = evidence.layout
    own, others = layout.slices()[group], evidence.mode(absent=(group,), near=near)
    parts = evidence.parts(others)
    across, left = parts.back(evidence.G[:, own]), parts.left
    G = evidence.G[own, own] - across.T @ across
    score = evidence.g[own] - across.T @ parts.half
    spread = left / evidence.dof * G
    if nuisance_covariance is not None and evidence.normal.N is not None:
        slope = evidence.nuisance()
        own_slope = slope[own] - across.T @ parts.back(slope)
        spread = spread + own_slope @ nuisance_covariance @ own_slope.T
    size, axes = np.linalg.eigh(0.5 * (spread + spread.T))
    root = axes * np.sqrt(np.maximum(size, 0.0))
    drawn = rng.normal(size=(_DRAWS, len(size))) @ root.T
    every = np.concatenate([score[None], drawn])
    gain = _gain(evidence, group, G, every, left)
    return Asked(
        layout.groups[group].name, float(gain[0]), float((1 + np.sum(gain[1:] >= gain[0])) / (1 + _DRAWS))
    )


def _gain(evidence: Evidence, group: int, G: Floats, scores: Floats, left: float) -> Floats:
    """Twice the largest gain in log likelihood for each row of scores, (n, k) -> (n,)."""
    layout = evidence.layout
    own, dof = layout.groups[group], evidence.dof
    best = np.zeros(len(scores))
    for length in _LENGTHS:
        if length < layout.knots.shortest:
            continue
        L = np.kron(np.eye(len(own.columns)), layout.knots.root(length))
        size, axes = np.linalg.eigh(L.T @ G @ L)
        size = np.maximum(size, 0.0)
        squares = (scores @ (L @ axes)) ** 2
        for amplitude in _AMPLITUDES:
            power = (own.scale * amplitude) ** 2
            taken = np.minimum(squares @ (power / (1 + power * size)) / left, 1 - 1e-9)
            best = np.maximum(best, -dof * np.log1p(-taken) - np.sum(np.log1p(power * size)))
    return best
