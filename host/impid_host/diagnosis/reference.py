"""What a study knows from elsewhere, as rows of the regression: weighed payloads, and the robot of [prior].

A common factor on the torques, a mass that is always at the tip, a rotor's inertia that is always there: no
residual shows them, for they hide in the identified parameters. Beside a reference they show.
"""

from collections.abc import Mapping, Sequence
from decimal import Decimal

import numpy as np

from impid_host.diagnosis.base import Base
from impid_host.diagnosis.holdout import FIT
from impid_host.diagnosis.rows import REFERENCE, Run
from impid_host.signals.arrays import Floats
from impid_host.study.model import Study

# Relative standard deviation of a reference beside its rounding: no two identifications agree better.
_EXACT = 0.005
_WARM = 0.10  # of viscous friction, which follows the temperature of the grease


def weighed(study: Study) -> dict[str, float]:
    """Mass by mass-spring load, kg, where all trials of a load were weighed alike."""
    masses: dict[str, set[float]] = {}
    for trial in study.of_kind("mass-spring"):
        masses.setdefault(trial.load, set()).add(trial.payload_kg or 0.0)
    return {load: min(own) for load, own in masses.items() if len(own) == 1 and min(own) > 0}


def reference_run(base: Base, study: Study) -> Run | None:
    """One row for each weighed load and each parameter of an earlier robot, in its own standard deviations.

    Returns:
        None where nothing is known from elsewhere.
    """
    rows = [*_payload_rows(base, weighed(study), study.setup.tolerance.payload_kg)]
    if study.setup.prior_alpha is not None:
        rows += _prior_rows(base, study.setup.prior_alpha)
    return _as_run(rows, base.size) if rows else None


def payload_run(base: Base, masses: Mapping[str, float], tolerance_kg: float) -> Run:
    """The rows that weighing these payloads (kg, by load) adds."""
    return _as_run(_payload_rows(base, masses, tolerance_kg), base.size)


def _as_run(rows: Sequence[tuple[int, float, float]], size: int) -> Run:
    target = np.array([value / sd for _, value, sd in rows])
    design = np.zeros((len(rows), size))
    for k, (column, _, sd) in enumerate(rows):
        design[k, column] = 1.0 / sd
    none = np.zeros(0, dtype=np.intp)
    nothing = np.zeros((len(rows), 0), dtype=np.float32)
    return Run("", REFERENCE, 0, FIT, 0.0, 0.0, target, design, none, nothing)


def _payload_rows(
    base: Base, masses: Mapping[str, float], tolerance_kg: float
) -> list[tuple[int, float, float]]:
    """Column, value and standard deviation of each mass."""
    return [
        (base.slot(name).start, masses[name], float(np.hypot(tolerance_kg, _EXACT * masses[name])))
        for name, load in base.loads
        # The first column of a mass-spring load is its mass.
        if name in masses and load.name == "mass-spring"
    ]


def _prior_rows(base: Base, prior: Sequence[float]) -> list[tuple[int, float, float]]:
    units = base.model.parameter_units
    if len(prior) not in (len(units), len(base.structure.parameter_names)):
        return []
    prior = prior[: len(units)]  # offsets are the record's own, and dry friction is no reference for anything
    inertial = np.array([not unit.startswith("N") for unit in units])
    sizes = _main_sizes(np.array(prior), units)
    sd = np.where(inertial, _EXACT, _WARM) * sizes
    return [(k, float(value), float(np.hypot(sd[k], _rounding(value)))) for k, value in enumerate(prior)]


def _rounding(value: float) -> float:
    """Standard deviation of what was cut off behind the last digit that was written."""
    exponent = Decimal(repr(float(value))).as_tuple().exponent
    return float(10.0 ** int(exponent) / 12**0.5)


def _main_sizes(value: Floats, units: Sequence[str]) -> Floats:
    """What each parameter is compared with: its own size, but no less than half the largest of its unit."""
    return np.array(
        [
            max(abs(own), 0.5 * max(abs(v) for v, u in zip(value, units, strict=True) if u == unit))
            for own, unit in zip(value, units, strict=True)
        ]
    )
