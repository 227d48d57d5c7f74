"""What unnamed structures are made of: a channel, a variable, columns."""

from collections.abc import Callable

import numpy as np

from impid_host.effects.effect import UNATTRIBUTED, Term
from impid_host.effects.view import FORCE, SPECIFIC_FORCE, TORQUE, Columns, View
from impid_host.signals.arrays import Floats


def channel_name(family: str, channel: int) -> str:
    """`tau1`, `fsx`, `acc_x`: how a measured channel is spoken of."""
    start = {TORQUE: "tau", FORCE: "fs", SPECIFIC_FORCE: "acc_"}[family]
    return f"{start}{channel + 1}" if family == TORQUE else f"{start}{'xy'[channel]}"


def on_channel(view: View, family: str, channel: int, basis: Floats) -> Columns:
    """Columns (N, k) on one channel of one family; nothing where the trial does not measure it."""
    if family == FORCE and (view.force is None or view.load is None):
        return {}
    if family == SPECIFIC_FORCE and view.predicted is None:
        return {}
    width = view.joints if family == TORQUE else 2
    block = np.zeros((len(view.t), width, basis.shape[1]))
    block[:, channel] = basis
    return {family: block}


def unnamed(
    on: str, variable: str, columns: Callable[[View, float], Columns], size: int, variant: str
) -> Term:
    """A term without a name: on which channel, of which variable."""
    return Term(UNATTRIBUTED, (on, variable), columns, lambda _beta, _shape: {}, size=size, variant=variant)
