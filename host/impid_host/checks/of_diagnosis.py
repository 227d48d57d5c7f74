"""A diagnosis before the gate: its last stage decides, since a named effect may make its first possible."""

from collections.abc import Mapping

import numpy as np

from impid_host.checks.check import Checks
from impid_host.checks.gate import LoadNumbers, RobotNumbers, gate
from impid_host.checks.of_effects import bounded
from impid_host.checks.signals import signals_of
from impid_host.diagnosis.base import structure_of
from impid_host.diagnosis.result import Diagnosis, Number
from impid_host.effects.effect import UNATTRIBUTED
from impid_host.impedance.matrices import Quantity
from impid_host.robot.model import RobotModel
from impid_host.study.model import Study

_OF_RESULTS = ("result.", "vaf.", "methods.", "trials.", "accelerations.")


def beside_diagnosis(study: Study, answer: Diagnosis, before: Checks) -> Checks:
    """What was found before, and the gate of the last stage, which decides.

    A first model with an impossible inertia, or with trials that disagree, is evidence for a named effect
    that makes both right, and no error of the input.
    """
    last = gate_diagnosis(study, answer)
    named = any(s.added is not None and s.added.effect != UNATTRIBUTED for s in answer.stages)
    explained = named and answer.above_noise_floor is not True and last.trusted
    return (of_input(before) if explained else before).with_more(last)


def of_input(before: Checks) -> Checks:
    """Without what was said of the first model's numbers, where another model takes its place."""
    return Checks.of(own for own in before if not own.what.startswith(_OF_RESULTS))


def gate_diagnosis(study: Study, answer: Diagnosis) -> Checks:
    """The last stage's robot and loads, against physics."""
    last = answer.stages[-1]
    signals = signals_of(study)
    model = signals.model
    theta = [trial.theta for trial in signals.trials]
    kinds = {trial.load: trial.kind for trial in signals.trials}
    robot = RobotNumbers(
        structure_of(study.setup, model),
        last.alpha_names,
        last.alpha.value,
        _covariance(last.alpha),
        np.concatenate(theta) if theta else np.zeros((0, model.joints)),
    )
    loads = load_numbers(last.loads, kinds, model)
    return gate(robot=robot, loads=loads, parameters=bounded(last.chosen))


def load_numbers(
    loads: Mapping[str, Mapping[str, Number]], kinds: Mapping[str, str], model: RobotModel
) -> list[LoadNumbers]:
    """Reported matrices for the gate; a load of which no kind is known may be an arm."""
    return [
        LoadNumbers(
            name,
            "mass-spring" if kinds.get(name) == "mass-spring" else "arm",
            _quantity(load.get("M")),
            _quantity(load.get("B")),
            _quantity(load.get("K")),
            model.task_axes == ("theta",),
        )
        for name, load in loads.items()
    ]


def _quantity(number: Number | None) -> Quantity | None:
    if number is None or number.value.ndim != 2:
        return None
    half = 0.5 * (number.ci95[..., 1] - number.ci95[..., 0])
    return Quantity(number.value, number.ci95, number.unit, half / 1.96)


def _covariance(number: Number) -> np.ndarray:
    if number.covariance is not None:
        return number.covariance
    half = 0.5 * (number.ci95[..., 1] - number.ci95[..., 0])
    return np.diag((half / 1.96) ** 2)
