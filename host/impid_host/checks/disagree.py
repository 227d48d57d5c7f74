"""What still contradicts itself when no discrete mistake explains it: named as a disagreement, not a cause."""

from collections.abc import Iterator

import numpy as np

from impid_host.checks.axes import AxisMap
from impid_host.checks.check import Check
from impid_host.checks.equations import Motions
from impid_host.checks.joint_fit import JointFit
from impid_host.checks.mistakes import accelerometer, force
from impid_host.checks.signals import Signals

# Half of what is worth a word by itself (5 % of K or M), and far outside of what noise does.
LEAST = 0.04
SIGMAS = 8.0
_CLOCKS = 0.05
_NEGATIVE = 1.0


def disagreements(study: Signals, fit: JointFit, motions: Motions) -> Iterator[Check]:
    """The pairs of measurements that do not agree, and what physics refuses, with no mistake behind it."""
    for violation in fit.violations:
        if violation.odd_size:
            continue
        yield Check(
            "result.impossible",
            violation.where,
            "impossible",
            f"{violation.words}, and no single mistake explains it",
            {"value": violation.value},
            "look at signs, units and order of the channels; `impid-host info` lists what was read",
        )
    for violation in fit.violations:
        if violation.odd_size:
            yield Check(
                "torque.unit",
                violation.where,
                "suspect",
                violation.words,
                {"value": violation.value},
                "check the unit of tau (N m), of angles (rad) and of lengths (m)",
            )
    if study.planar:
        yield from _accelerations(accelerometer.acceleration_map(study, motions, study.mount))
        robot = force.by_torques(study, motions) if force.has_force(study) else None
        if robot is not None:
            yield from _forces(force.force_map(study, motions, robot, study.force_frame))
    yield from _angles(fit)


def _far(found: AxisMap) -> bool:
    return found.deviation > max(LEAST, SIGMAS * found.sd)


def _accelerations(found: AxisMap | None) -> Iterator[Check]:
    if found is not None and _far(found):
        yield Check(
            "accelerations.disagree",
            "sensor",
            "contradiction",
            f"accelerometer and encoders differ by up to {100 * found.deviation:.1f} % (standard error "
            f"{100 * found.sd:.2g} %)",
            {"map": np.round(found.raw, 4), "standard_error": found.sd},
            "run `impid-host diagnose`: the sensor's gain or place, a link's length or an encoder may be off",
        )


def _forces(found: AxisMap | None) -> Iterator[Check]:
    if found is not None and _far(found):
        yield Check(
            "methods.disagree",
            "",
            "contradiction",
            f"force sensor and torques differ by up to {100 * found.deviation:.1f} % (standard error "
            f"{100 * found.sd:.2g} %), and Methods 1 and 2 with them",
            {"map": np.round(found.raw, 4), "standard_error": found.sd},
            "run `impid-host diagnose`: an effect that the model lacks may be behind it",
        )


def _angles(fit: JointFit) -> Iterator[Check]:
    for channel, r in fit.left.items():
        joint = f"joint{channel[-1]}"
        if channel.startswith("theta") and r > _CLOCKS:
            yield Check(
                "clocks.disagree",
                joint,
                "contradiction",
                f"module and controller read one encoder, and {100 * r:.1f} % of joint {channel[-1]}'s motion "
                "differs between them",
                {"share": r},
                "run `impid-host diagnose`: the clocks may drift, or an encoder miss counts",
            )
