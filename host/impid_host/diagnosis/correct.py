"""A trial as it would have been measured without the chosen effects."""

from collections.abc import Sequence
from dataclasses import replace

from impid_host.diagnosis.base import Base
from impid_host.diagnosis.result import Chosen
from impid_host.diagnosis.rows import columns_in
from impid_host.effects.view import View
from impid_host.signals.arrays import Floats


def corrected(view: View, chosen: Sequence[Chosen]) -> View:
    """Effects with an exact inverse are undone; the others' columns are subtracted from what was measured."""
    for part in chosen:
        if part.term.undo is not None and part.term.acts_in(view):
            view = part.term.undo(view, part.beta, part.shape)
    for part in chosen:
        if part.term.undo is not None:
            continue
        columns = columns_in(part.term, view, part.shape)
        if "torque" in columns:
            view = replace(view, tau=view.tau - columns["torque"] @ part.beta)
        if "specific_force" in columns and view.measured is not None:
            view = replace(view, measured=view.measured - columns["specific_force"] @ part.beta)
        if "force" in columns and view.force is not None:
            view = replace(view, force=view.force + columns["force"] @ part.beta)
    return view


def with_true_model(view: View, chosen: Sequence[Chosen], base: Base, value: Floats) -> View:
    """The view with the model at `value` in it, of the motion as it truly was.

    Torque and equilibrium are those with the effects taken out of the motion; what the log holds of the
    effects is not the model's.
    """
    true = base.informed(corrected(view, chosen), value)
    return replace(base.informed(view, value), torque_model=true.torque_model, x0=true.x0, K=true.K)
