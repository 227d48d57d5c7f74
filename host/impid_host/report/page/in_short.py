"""The numbers that a clinician asks for, a sentence for each load, below the opening sentence."""

import numpy as np

from impid_host.checks.pushes import Push
from impid_host.diagnosis.result import Number
from impid_host.impedance.identify import LoadFit
from impid_host.impedance.matrices import Quantity
from impid_host.report.fit_tables import number
from impid_host.report.page.findings import Findings
from impid_host.signals.arrays import Floats

_LETTERS = {"K": "stiffness", "M": "inertia"}
_AXES = {1: ("",), 2: (" along x", " along y"), 3: (" along x", " along y", " along z")}


def in_short(findings: Findings) -> list[str]:
    """Stiffness and inertia of each load by the last model, and the stretches to look at."""
    if not findings.trusted:
        return []  # the page says above not to use the numbers
    loads = _loads(findings).items()
    words = {load: [_words(_LETTERS[key], own[key]) for key in _LETTERS if key in own] for load, own in loads}
    lines = [f"{load}: {'; '.join(told)} (± is the 95 % interval)" for load, told in words.items() if told]
    return [*lines, *(_unlike(push) for push in findings.pushes.found)]


def _unlike(push: Push) -> str:
    where = f"{push.trial} from {push.begin_s:.0f} to {push.end_s:.0f} s"
    why = "somebody pushed, something slipped, or the model lacks something"
    return f"{where} is unlike the rest of its trial: {why}; what it changes stands in the tables below"


def _loads(findings: Findings) -> dict[str, dict[str, Number | Quantity]]:
    """By load and letter; by the virtual sensor where a fit has both."""
    if findings.diagnosis is not None:
        return {load: dict(own) for load, own in findings.diagnosis.stages[-1].loads.items()}
    found: dict[str, dict[str, Number | Quantity]] = {}
    for fit in () if findings.fit is None else findings.fit.loads:
        found.setdefault(fit.load, _of_fit(fit))
    return found


def _of_fit(fit: LoadFit) -> dict[str, Number | Quantity]:
    return {"K": fit.K, "M": fit.M}


def _words(what: str, quantity: Number | Quantity) -> str:
    """The diagonal; once where a load has the same along every axis."""
    value, ends = np.atleast_2d(quantity.value), np.asarray(quantity.ci95)
    axes = range(len(value))
    entries = [_entry(float(value[k, k]), ends.reshape(*value.shape, 2)[k, k]) for k in axes]
    unit = quantity.unit.replace("*", "·").replace("^2", "²")
    if len(set(entries)) == 1:
        return f"{what} {entries[0]} {unit}"
    names = _AXES.get(len(value), tuple(f" {k + 1}" for k in axes))
    return f"{what} " + ", ".join(f"{entry} {unit}{name}" for entry, name in zip(entries, names, strict=True))


def _entry(value: float, ci: Floats) -> str:
    return f"{number(value, ci)} ± {number(0.5 * float(ci[1] - ci[0]), ci)}"
