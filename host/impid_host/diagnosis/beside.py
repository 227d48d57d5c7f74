"""What of an unnamed structure the first model has no place for.

A curve of a joint's angle holds the straight line that is a stiffness, one of its speed the viscous friction.
Taken out of the signals whole, it takes the robot's and the load's own parameters along, or leaves them
undetermined. A discrepancy must be orthogonal to the model beside which it stands (Plumlee, Bayesian
calibration of inexact computer models, J. Am. Stat. Assoc. 112, 2017): the model's own parameters explain all
that they can.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from impid_host.diagnosis.case import Case
from impid_host.diagnosis.noise import Taps, whitened
from impid_host.diagnosis.result import Chosen
from impid_host.diagnosis.rows import rows_of, slots_of
from impid_host.effects.effect import Value
from impid_host.effects.view import Columns, View
from impid_host.signals.arrays import Floats

_ALIKE = 0.9  # of a direction's squares: the model's own columns would widen their intervals threefold for it
_NOTHING = 1e-6


def beside(case: Case, part: Chosen, taps: Taps) -> Chosen | None:
    """The structure without the directions that the first model has itself; None where none is left.

    Args:
        taps: noise models, in whose measure directions are alike.
    """
    slots = slots_of([replace(part.term, shapes=(part.shape,))])
    raw = [run for view in case.fit_views for run in rows_of(view, case.base, slots, case.holdout)]
    runs = whitened(raw, taps)
    columns_of_all = np.concatenate([run.columns(np.arange(part.term.size)) for run in runs])
    kept = _own(columns_of_all, np.concatenate([run.base for run in runs]))
    if kept.shape[1] == 0:
        return None
    inner = part.term

    def columns(view: View, shape: float) -> Columns:
        return {family: block @ kept for family, block in inner.columns(view, shape).items()}

    def read(beta: Floats, shape: float) -> Mapping[str, Value]:
        return inner.read(kept @ beta, shape)

    term = replace(inner, columns=columns, read=read, size=kept.shape[1], nuisance=0)
    beta: Floats = np.asarray(np.linalg.lstsq(kept, part.beta, rcond=None)[0], dtype=np.float64)
    return Chosen(term, part.shape, beta, np.zeros((len(beta), len(beta))))


def _own(columns: Floats, base: Floats) -> Floats:
    """Combinations of the columns (q, k) that the base explains to less than `_ALIKE` of their squares."""
    size = np.linalg.norm(columns, axis=0)
    used = np.flatnonzero(size > _NOTHING * size.max(initial=0.0))
    none = np.zeros((columns.shape[1], 0))
    if len(used) == 0:
        return none
    U, s, Vt = np.linalg.svd(columns[:, used] / size[used], full_matrices=False)
    rank = s > _NOTHING * s[0]
    own = base / (np.linalg.norm(base, axis=0) + 1e-300)
    W, t, _ = np.linalg.svd(own, full_matrices=False)
    W = W[:, t > _NOTHING * t[0]]
    _, alike, turn = np.linalg.svd(W.T @ U[:, rank], full_matrices=True)
    explained = np.zeros(turn.shape[0])
    explained[: len(alike)] = alike**2
    result = np.zeros((columns.shape[1], int(np.sum(explained < _ALIKE))))
    back = (Vt[rank].T / s[rank]) @ turn[explained < _ALIKE].T
    result[used] = back / size[used][:, None]
    return result


def curves_beside(case: Case, parts: Sequence[Chosen], taps: Taps) -> list[Chosen]:
    """Each of the structures by `beside`, without those of which nothing is left."""
    found = [beside(case, part, taps) for part in parts]
    return [part for part in found if part is not None]
