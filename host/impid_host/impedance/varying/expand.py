"""Rows of a regression whose parameters are curves: products first, then the low-pass, then thinned."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.identify import RobotParameters
from impid_host.impedance.linear import Stretch
from impid_host.impedance.loads import LoadModel
from impid_host.impedance.rows import Equation, finish, stretches
from impid_host.impedance.varying.posterior import Layout
from impid_host.impedance.virtual_sensor import through_jacobian
from impid_host.signals.align import AlignedTrial
from impid_host.signals.arrays import Floats
from impid_host.signals.chain import Chain, erode
from impid_host.signals.resample import thinned

_SIGNALS = ("theta", "omega", "theta_dd", "tau", "force", "x", "v", "a")
# Curves are slow: their products with what lies above so many times the cut-off stay above the cut-off.
_PER_CUTOFF = 16.0


@dataclass(frozen=True, slots=True)
class Scheduled:
    """A trial with its scheduling variable s (N,) on the same grid."""

    trial: AlignedTrial
    s: Floats


def thin(part: Scheduled, chain: Chain) -> Scheduled:
    """As many samples as the narrow filter needs."""
    trial = part.trial
    step = int(trial.rate_hz / (_PER_CUTOFF * chain.cutoff_hz)) if chain.finish is not None else 1
    if step < 2:
        return part
    kept: dict[str, Any] = {
        name: thinned(v, step) for name in _SIGNALS if (v := getattr(trial, name)) is not None
    }
    slow = replace(
        trial,
        **kept,
        perturbation=None,
        t=trial.t[::step],
        rate_hz=trial.rate_hz / step,
        valid=trial.valid[::step],
    )
    return Scheduled(slow, part.s[::step])


def expanded(
    part: Scheduled,
    load: LoadModel,
    place: Floats,
    layout: Layout,
    robot: RobotParameters | None,
    chain: Chain,
) -> list[Stretch]:
    """-F_ext = A @ constants + sum of A_q curve_q(s), finished; stretches in the order of `layout`.

    Args:
        place: reference position (d,) from which the load is taken.
        robot: for the virtual sensor; None: the log's forces.

    Raises:
        UndeterminedError: forces were asked for that the trial does not have.
    """
    trial = part.trial
    A = load.regressor(trial.x - place, trial.v, trial.a)
    known = np.isfinite(part.s)
    W = layout.knots.weights(np.where(known, part.s, layout.knots.low))
    curves = [(A[:, :, q, None] * W[:, None, :]) for group in layout.groups for q in group.columns]
    design = finish(chain, np.concatenate([A, *curves], axis=2), trial.rate_hz)
    nuisance = None
    if robot is None:
        if trial.force is None:
            raise UndeterminedError(
                f"trial {trial.name}: no fx, fy in robot.csv, so Method 2 has nothing to fit"
            )
        target = -finish(chain, trial.force, trial.rate_hz)
    else:
        Y = robot.structure.regressor(trial.theta, trial.omega, trial.theta_dd, 1 / trial.rate_hz)
        model = robot.structure.model
        slope = finish(chain, through_jacobian(model, trial.theta, Y), trial.rate_hz)
        torque = finish(chain, through_jacobian(model, trial.theta, trial.tau), trial.rate_hz)
        target, nuisance = torque - slope @ robot.value, -slope
    usable = trial.valid & (known if known.all() else erode(known, int(trial.rate_hz / chain.cutoff_hz)))
    return stretches(Equation(trial, design, target, nuisance), usable, chain)


def blocks_of(rows: Sequence[Stretch]) -> list[Floats]:
    """Design, target and nuisance beside each other, (N, c, p + 1 + k)."""
    return [
        np.concatenate(
            [s.design, s.target[:, :, None], *([] if s.nuisance is None else [s.nuisance])], axis=2
        )
        for s in rows
    ]


def of_blocks(blocks: Sequence[Floats], p: int) -> list[Stretch]:
    """Back from `blocks_of`."""
    return [
        Stretch(b[:, :, :p], b[:, :, p], b[:, :, p + 1 :] if b.shape[2] > p + 1 else None) for b in blocks
    ]


def equilibrium_offset(mean: Floats, load: LoadModel, layout: Layout) -> Floats:
    """The offset (d,) of the reference position that explains K(s) x0(s) best, by the parameters' mean."""
    d, places = len(load.axes), layout.knots.grid(layout.knots.count)
    K = np.zeros((len(places), d, d))
    for q, column in enumerate(load.columns):
        if column.signal == "x":
            for row, axis in column.entries:
                K[:, row, axis] = layout.curve(q, places) @ mean
    c = np.stack([layout.curve(q, places) @ mean for q in load.place], axis=1)
    return np.asarray(np.linalg.lstsq(K.reshape(-1, d), c.ravel(), rcond=1e-6)[0], dtype=np.float64)


def recentred(rows: Sequence[Stretch], load: LoadModel, layout: Layout, offset: Floats) -> list[Stretch]:
    """The same rows with positions taken from a reference that lies `offset` (d,) further."""
    where = {q: layout.columns_of(q) for q in range(len(load.columns))}
    out = []
    for row in rows:
        design = row.design.copy()
        for q, column in enumerate(load.columns):
            if column.signal == "x":
                for axis_of_force, axis in column.entries:
                    # The column of K x0 is -1 where that of K is the position.
                    design[:, :, where[q]] += (
                        offset[axis] * row.design[:, :, where[load.place[axis_of_force]]]
                    )
        out.append(replace(row, design=design))
    return out
