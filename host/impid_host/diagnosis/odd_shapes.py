"""The machine's structures without a name, as shapes that a reader can look at."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from impid_host.diagnosis.result import Structure
from impid_host.diagnosis.rows import Slot
from impid_host.effects.odd_machine import AT_TIP, BY_PULL, BY_TORQUE, ENCODER, ENCODER_ERRORS, pull
from impid_host.effects.structure import values_of
from impid_host.effects.view import View
from impid_host.signals.arrays import Floats

_POINTS = 41
Described = tuple[Floats, Floats, Callable[[Floats], str]]
"""Grid (n,), what one unit of each parameter adds there (n, q), and the sentence of the curve (n,)."""


def of_machine(
    slot: Slot, share: float, beta: Floats, covariance: Floats, views: Sequence[View]
) -> Structure:
    """The curve with its band, and a sentence."""
    on, variable = slot.term.where
    grid, basis, sentence = ODD_MACHINE[slot.term.variant](slot, beta, views)
    curve, band = banded(grid, basis, beta, covariance)
    return Structure(variable, on, share, curve, band, sentence(curve[:, 1]))


def banded(grid: Floats, basis: Floats, beta: Floats, covariance: Floats) -> tuple[Floats, Floats]:
    """A linear curve over its grid and its 95 % limits, both (n, 2).

    Args:
        basis: what one unit of each parameter adds at each place, (n, q).
    """
    curve = basis @ beta
    half = 1.96 * np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", basis, covariance, basis), 0))
    return np.stack([grid, curve], axis=1), np.stack([curve - half, curve + half], axis=1)


def _by_pull(slot: Slot, _beta: Floats, views: Sequence[View]) -> Described:
    values = np.concatenate([pull(view)[view.valid] for view in views])
    grid = np.linspace(0.0, float(np.percentile(values, 99.5)), _POINTS)

    def sentence(curve: Floats) -> str:
        on = slot.term.where[0]
        return f"{on} has dry friction that changes by {np.ptp(curve):.2g} N m with the {BY_PULL}"

    return grid, grid[:, None], sentence


def _by_torque(slot: Slot, _beta: Floats, views: Sequence[View]) -> Described:
    on = slot.term.where[0]
    joint = int(on[-1]) - 1
    values = np.concatenate([np.abs(view.torque_model[view.valid, joint]) for view in views])
    grid = np.linspace(0.0, float(np.percentile(values, 99.5)), _POINTS)

    def sentence(curve: Floats) -> str:
        most = float(curve[np.argmax(np.abs(curve))])
        return f"{on} is no straight line of the {BY_TORQUE}: {most:+.2g} N m at {grid[-1]:.2g} N m"

    return grid, np.stack([grid**2, grid**3], axis=1), sentence


def _at_tip(_slot: Slot, beta: Floats, views: Sequence[View]) -> Described:
    """No curve: it depends on where the end-effector came from."""
    axes = len(views[0].x[0])
    each = np.abs(beta).reshape(axes, -1).sum(axis=1)
    pairs = zip(each, ("x", "y")[-axes:], strict=True)
    size = " and ".join(f"{force:.2g} N along {axis}" for force, axis in pairs)
    none = np.zeros((0, len(beta)))
    return none[:, 0], none, lambda _curve: f"something like {AT_TIP}, a spring until it slides: up to {size}"


def _encoder(slot: Slot, beta: Floats, views: Sequence[View]) -> Described:
    """The angle error by a lead in time, against the first joint's speed."""
    on, variable = slot.term.where
    values = np.concatenate([values_of(view, variable)[view.valid] for view in views])
    low, high = (float(v) for v in np.percentile(values, [0.2, 99.8]))
    grid = np.linspace(low, high, _POINTS)
    names = on.split("+")
    parts = [
        f"of joint {name[-1]} by "
        + ", ".join(f"{v:.2g} {unit}" for v, unit in zip(own, ENCODER_ERRORS, strict=True))
        for name, own in zip(names, np.split(beta, len(names)), strict=True)
    ]
    basis = np.zeros((_POINTS, len(beta)))
    basis[:, 0] = grid
    return grid, basis, lambda _curve: f"an encoder is not where its joint is: {' and '.join(parts)}"


ODD_MACHINE: Mapping[str, Callable[[Slot, Floats, Sequence[View]], Described]] = {
    BY_PULL: _by_pull,
    BY_TORQUE: _by_torque,
    AT_TIP: _at_tip,
    ENCODER: _encoder,
}
