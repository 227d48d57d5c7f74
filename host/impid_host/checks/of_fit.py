"""A finished fit before the gate: numbers of `fit`, of a saved model, of spectra; negative VAFs."""

from collections.abc import Iterator

import numpy as np

from impid_host.checks.check import Check, Checks
from impid_host.checks.gate import LoadNumbers, gate
from impid_host.impedance.campaign import StudyFit
from impid_host.impedance.identify import RobotFit
from impid_host.robot.model import robot_model
from impid_host.study.model import Study

# Below zero the model is worse than a constant; a trial in which next to nothing moves comes near it.
_NEGATIVE = -5.0
_METHODS = {"virtual sensor": "Method 1", "physical sensor": "Method 2"}


def gate_fit(study: Study, result: StudyFit) -> Checks:
    """Everything that the fit is about to print, against physics."""
    robot = result.robot
    parameters = robot.parameters if isinstance(robot, RobotFit) else robot
    model = robot_model(study.setup.robot)
    p = len(model.parameter_names)
    whole = isinstance(robot, RobotFit) and parameters.unseen is None and len(parameters.value) >= p
    theta = [trial.theta[trial.valid] for trial in result.trials if trial.kind == "free"]
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
    found = gate(
        model=model if whole else None,
        alpha=parameters.value[:p] if whole else None,
        covariance=parameters.covariance[:p, :p] if whole else None,
        theta=np.concatenate(theta) if theta else None,
        loads=loads,
    )
    return found.with_more(_negative(result)).with_more(_undetermined(result))


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
        for joint, vaf in enumerate(result.robot.vaf):
            if vaf < _NEGATIVE:
                yield _worse(f"joint{joint + 1}", f"the robot's torque on joint {joint + 1}", float(vaf))


def _worse(where: str, what: str, vaf: float) -> Check:
    return Check(
        "vaf.negative",
        where,
        "contradiction",
        f"{what}: VAF {vaf:.4g} % on data that took no part, worse than a constant would be",
        {"vaf": vaf},
        "run `impid-host check STUDY`; a trial may not be what its label says",
    )
