"""A diagnosis before the gate: its last stage decides, since a named effect may make its first possible."""

import numpy as np

from impid_host.checks.check import Checks
from impid_host.checks.gate import LoadNumbers, gate
from impid_host.checks.signals import signals_of
from impid_host.diagnosis.result import Diagnosis, Number
from impid_host.effects.effect import UNATTRIBUTED
from impid_host.impedance.matrices import Quantity
from impid_host.study.model import Study

_OF_RESULTS = ("result.", "vaf.", "methods.", "trials.", "accelerations.")


def beside_diagnosis(study: Study, answer: Diagnosis, before: Checks) -> Checks:
    """What was found before, and the gate of the last stage, which decides.

    A first model with an impossible inertia, or with trials that disagree, is evidence for a named effect
    that makes
    both right, and no error of the input.
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
    whole = last.alpha_names == tuple(model.parameter_names)
    theta = [trial.theta for trial in signals.trials if trial.kind == "free"]
    kinds = {trial.load: trial.kind for trial in signals.trials}
    loads = [
        LoadNumbers(
            name,
            "arm" if kinds.get(name) == "arm" else "mass-spring",
            _quantity(load.get("M")),
            _quantity(load.get("B")),
            _quantity(load.get("K")),
            model.task_axes == ("theta",),
        )
        for name, load in last.loads.items()
    ]
    return gate(
        model=model if whole and theta else None,
        alpha=last.alpha.value if whole else None,
        covariance=_covariance(last.alpha) if whole else None,
        theta=np.concatenate(theta) if theta else None,
        loads=loads,
    )


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
