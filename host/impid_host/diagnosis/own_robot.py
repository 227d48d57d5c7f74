"""The robot behind a study's virtual forces: from free trials, loads on a force sensor, or a prior."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from impid_host.diagnosis.base import Base
from impid_host.effects.view import View
from impid_host.errors import UndeterminedError
from impid_host.impedance.combinations import combinations
from impid_host.impedance.identify import RobotParameters
from impid_host.impedance.linear import Estimate, Stretch, fit_linear
from impid_host.robot.terms import RobotStructure
from impid_host.signals.align import AlignedTrial
from impid_host.signals.chain import Chain


def without_load(view: View, trial: AlignedTrial) -> AlignedTrial:
    """The trial with the sensor's force taken out of the torque: tau + J^T F_ext is the robot's own."""
    if view.load is None or trial.force is None:
        return trial
    return replace(trial, tau=trial.tau + np.einsum("kij,ki->kj", view.J, trial.force))


def shows_robot(pairs: Sequence[tuple[View, AlignedTrial]]) -> list[tuple[View, AlignedTrial]]:
    """Free trials; where there are none, those on a force sensor, less the load."""
    free = [(view, trial) for view, trial in pairs if view.load is None]
    if free:
        return free
    measured = all(trial.force is not None for _, trial in pairs)
    return [(view, without_load(view, trial)) for view, trial in pairs] if measured else []


def estimate_robot(rows: Sequence[Stretch], structure: RobotStructure, chain: Chain) -> Estimate:
    """All parameters, (p,); where the rows leave some open, the combinations that they do determine.

    A combination stands in the place of its first parameter, under its own name; the others are zero.

    Raises:
        UndeterminedError: the rows determine nothing.
    """
    names, units = structure.parameter_names, structure.parameter_units
    try:
        return fit_linear(rows, names, units, ar_order=chain.ar_order)
    except UndeterminedError:
        part = combinations(rows, names)
        kept = list(part.kept)
        if len(kept) == len(names):
            raise
    own = tuple(units[k] for k in kept)
    found = fit_linear([part.cut(stretch) for stretch in rows], part.labels, own, ar_order=chain.ar_order)
    labels = dict(zip(kept, part.labels, strict=True))
    lift = np.eye(len(names))[:, kept]
    return replace(
        found,
        names=tuple(labels.get(k, f"{name} (not determined)") for k, name in enumerate(names)),
        units=units,
        value=lift @ found.value,
        covariance=lift @ found.covariance @ lift.T,
    )


def given_robot(base: Base, prior: Sequence[float] | None) -> RobotParameters:
    """The robot that no trial shows: none at a torque sensor, else the prior.

    Raises:
        UndeterminedError: there is no prior, or it is of another model.
    """
    structure = base.structure
    size = len(structure.parameter_names)
    none = np.zeros((size, size))
    if base.bare:
        return RobotParameters(structure, np.zeros(size), none, "none")
    if prior is None or len(prior) != size:
        told = "" if prior is None else f" ([prior] has {len(prior)})"
        raise UndeterminedError(
            f"no free trial, no force sensor and no [prior] alpha of {size} values "
            f"({', '.join(structure.parameter_names)}) in setup.toml{told}, so the robot is unknown; "
            "record a free trial"
        )
    return RobotParameters(structure, np.array(prior), none, "prior")
