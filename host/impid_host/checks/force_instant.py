"""Whether the force sensor is read as `[force_sensor] timing` says: a held command's steps tell."""

from collections.abc import Iterator

import numpy as np

from impid_host.checks.check import Check
from impid_host.signals.align import robot_rows
from impid_host.signals.force_timing import first_of_reading, following
from impid_host.study.model import Study

# Half a row lies between a reading in one instant and a mean.
_OFF = 0.2
_SIGMAS = 5.0


def force_instants(study: Study) -> Iterator[Check]:
    """One entry where steps of the command reach the readings otherwise than those of a mean would."""
    instant = study.setup.force_sensor.timing == "instant"
    late, sds, periods, held = [], [], [], []
    for trial in study.trials:
        log = robot_rows(trial.robot)
        if log.force is None or len(log) < 1000:
            continue
        first = first_of_reading(log.force) & np.isfinite(log.force).all(axis=1)
        held.append(len(first) / max(int(first.sum()), 1))
        if log.perturbation is None or not np.any(log.perturbation):
            continue
        found = following(log.force[first], log.perturbation[first], log.t[first])
        if found is not None and found.sd < _OFF / _SIGMAS:
            late.append(found.steps)
            sds.append(found.sd)
            periods.append(float(np.median(np.diff(log.t[first]))))
    if not instant and held and min(held) > 1.5:
        yield _said(
            f"each reading of the force sensor stands in {np.median(held):.3g} rows: it is held, and late by "
            "half of that time",
            {"rows_per_reading": float(np.median(held))},
            'setup.toml: [force_sensor] timing = "instant"',
        )
        return
    if not late:
        return
    steps, sd = float(np.mean(late)), float(np.sqrt(np.sum(np.square(sds))) / len(sds))
    expected = float(np.clip(round(steps), 0, 1)) if instant else 0.5
    if abs(steps - expected) < max(_OFF, _SIGMAS * sd):
        return
    off_s = abs(steps - expected) * float(np.median(periods))
    early = "early" if steps < expected else "late"
    yield _said(
        f"steps of the commanded force reach the sensor's readings {1e3 * off_s:.2f} ms too {early} for "
        + ("readings of one instant" if instant else "means over a row's period")
        + ": damping by Method 2 is off",
        {"rows_late": steps, "standard_error_rows": sd, "expected_rows": expected},
        'setup.toml: [force_sensor] timing = "mean"'
        if abs(steps - 0.5) < _OFF
        else 'setup.toml: [force_sensor] timing = "instant"'
        if not instant and min(abs(steps), abs(steps - 1)) < _OFF
        else "look for a filter's delay in the force sensor's path, or take B from Method 1",
    )


def _said(words: str, evidence: dict[str, object], remedy: str) -> Check:
    return Check("methods.disagree", "sensor", "suspect", words, evidence, remedy)
