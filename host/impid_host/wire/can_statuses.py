"""The sets of status frames that follow each other as they should, taken apart together (ten a second)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from impid_host.wire.messages import FIRST_STATUSES, STATUS, Words

STATUS_ALWAYS = frozenset(layout.frame_id for layout in STATUS[:FIRST_STATUSES])
STATUS_LAST = max(STATUS_ALWAYS)
_IDENTIFIERS = [layout.frame_id for layout in STATUS]
_WORTH_IT = 3  # sets


class RegularSets(NamedTuple):
    """Sets of one and the same make, without a frame lost between the first and the last.

    Attributes:
        frames: which of the frames given they are, (K,).
        last: which closes each set, (N,).
        words: in the order of STATUS, zeros behind those that were sent, (N, 8).
        sent: how many each set has.
    """

    frames: NDArray[np.intp]
    last: NDArray[np.intp]
    words: Words
    sent: int


def regular_sets(identifiers: NDArray[np.unsignedinteger], words: Words) -> RegularSets | None:
    """Those among frames (N,), all but an incomplete one at either end; None where they are not regular."""
    rows = np.flatnonzero(np.isin(identifiers, _IDENTIFIERS))
    kinds = identifiers[rows]
    begins = np.flatnonzero(kinds == _IDENTIFIERS[0])
    sets = len(begins) - 1
    if sets < _WORTH_IT:
        return None
    rows, kinds = rows[begins[0] : begins[-1]], kinds[begins[0] : begins[-1]]
    made_of = kinds[: begins[1] - begins[0]].tolist()
    if len(kinds) != sets * len(made_of) or not STATUS_ALWAYS.issubset(made_of):
        return None
    if made_of[-1] != STATUS_LAST or len(set(made_of)) != len(made_of):
        return None
    if not (kinds.reshape(sets, -1) == made_of).all():
        return None
    order = [made_of.index(identifier) for identifier in _IDENTIFIERS if identifier in made_of]
    told = np.zeros((sets, len(STATUS)), np.uint64)
    told[:, : len(order)] = words[rows].reshape(sets, -1)[:, order]
    return RegularSets(rows, rows[len(made_of) - 1 :: len(made_of)], told, len(order))
