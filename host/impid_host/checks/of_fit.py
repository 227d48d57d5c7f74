"""A finished fit before the gate: numbers of `fit`, of a saved model, of spectra; negative VAFs."""

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from impid_host.checks.check import Check, Checks
from impid_host.checks.gate import Bounded, LoadNumbers, RobotNumbers, gate
from impid_host.checks.physics import UNDRIVEN
from impid_host.impedance.campaign import StudyFit
from impid_host.impedance.identify import RobotFit

if TYPE_CHECKING:
    from impid_host.diagnosis.result import Chosen

# Below zero the model is worse than a constant; a trial in which next to nothing moves comes near it.
_NEGATIVE = -5.0
_METHODS = {"virtual sensor": "Method 1", "physical sensor": "Method 2"}


def gate_fit(result: StudyFit, effects: "Sequence[Chosen]" = ()) -> Checks:
    """Everything that the fit is about to print, against physics.

    Args:
        effects: of a saved model that the fit stands on.
    """
    robot = result.robot.parameters if isinstance(result.robot, RobotFit) else result.robot
    theta = [trial.theta[trial.valid] for trial in result.trials]
    names = robot.structure.parameter_names
    # Directions that the trials leave open make every number beside them arbitrary.
    known = robot.origin != "unknown" and robot.unseen is None and len(robot.value) == len(names)
    numbers = RobotNumbers(
        robot.structure,
        names,
        robot.value,
        robot.covariance,
        np.concatenate(theta) if theta else np.zeros((0, robot.structure.model.joints)),
    )
    loads = [
        LoadNumbers(
            f"{fit.load} ({_METHODS[fit.method]})", fit.model.name, fit.M, fit.B, fit.K, fit.model.rotary
        )
        for fit in result.loads
    ]
    loads += [
        LoadNumbers(f"{fit.load} (spectral, {_METHODS[fit.method]})", fit.on, fit.M, fit.B, fit.K)
        for fit in result.spectral
    ]
    found = gate(robot=numbers if known else None, loads=loads, parameters=_bounded(effects))
    return found.with_more(_negative(result)).with_more(_undetermined(result))


def _bounded(effects: "Sequence[Chosen]") -> "Iterable[Bounded]":
    if not effects:
        return ()
    from impid_host.checks.of_effects import bounded  # noqa: PLC0415  (the catalogue is slow to import)

    return bounded(effects)


def _undetermined(result: StudyFit) -> Iterator[Check]:
    """Loads of which the trials show combinations alone."""
    for fit in result.partial:
        yield Check(
            "result.undetermined",
            fit.load,
            "suspect",
            f"{fit.load}, {_METHODS[fit.method]}: {fit.reason}",
            {"trials": list(fit.trials)},
            "record a trial that moves along both axes and at more than one frequency",
        )


def _negative(result: StudyFit) -> Iterator[Check]:
    for fit in result.loads:
        for axis, vaf in zip(fit.model.axes, fit.vaf, strict=True):
            if vaf < _NEGATIVE:
                where = f"{fit.load} ({_METHODS[fit.method]})+{axis}"
                yield _worse(where, f"{fit.load} along {axis}, {_METHODS[fit.method]}", float(vaf))
    if isinstance(result.robot, RobotFit):
        driven = _driven(result)
        for joint, vaf in enumerate(result.robot.vaf):
            if vaf < _NEGATIVE and driven[joint]:
                yield _worse(f"joint{joint + 1}", f"the robot's torque on joint {joint + 1}", float(vaf))


def _driven(result: StudyFit) -> NDArray[np.bool_]:
    """The joints, (n,), whose torque varies: of a free joint's constant nothing can be explained."""
    spread = np.max([np.std(trial.tau[trial.valid], axis=0) for trial in result.trials], axis=0)
    return np.asarray(spread > UNDRIVEN * spread.max())


def _worse(where: str, what: str, vaf: float) -> Check:
    return Check(
        "vaf.negative",
        where,
        "contradiction",
        f"{what}: VAF {vaf:.4g} % on data that took no part, worse than a constant would be",
        {"vaf": vaf},
        "run `impid-host check STUDY`; a trial may not be what its label says",
    )
