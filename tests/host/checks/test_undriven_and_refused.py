"""A joint without a drive is not called impossible, and a refusal does not contradict a mistake that was named."""

import numpy as np
from impid_host.checks import Checks
from impid_host.checks.check import Check
from impid_host.checks.equations import Motions
from impid_host.checks.joint_fit import fit_jointly
from impid_host.checks.signals import signals_of
from impid_host.cli.checked import after_mistakes
from impid_host.study.model import RobotLog, RobotSetup, Setup, Study, Trial


def test_a_joint_without_a_drive_weighs_nothing_odd() -> None:
    """Two links of which only the first is driven: the second's column of torques is zero throughout."""
    t = 1e-2 * np.arange(3000)
    theta = np.stack([0.6 * np.sin(2.1 * t), 0.4 * np.sin(3.7 * t + 1)], axis=1)
    driven = -0.5 * 0.6 * 2.1**2 * np.sin(2.1 * t)
    tau = np.stack([driven, np.zeros_like(t)], axis=1)
    setup = Setup(RobotSetup("planar-2r-relative", (0.25, 0.25)))
    study = Study("s", setup, (Trial("free_01", "free", "free", RobotLog(t, theta, tau)),))
    found = fit_jointly(signals_of(study), Motions()).violations
    assert not [one for one in found if one.odd_size]


def test_a_refusal_ends_with_the_mistake_that_was_named() -> None:
    reason = "free trials leave open alpha1; record a free trial that moves every joint"
    named = Check("accel.axes", "sensor", "contradiction", "w", {}, "r")
    said = after_mistakes(reason, Checks.of([named]))
    assert said == "free trials leave open alpha1; mend accel.axes@sensor first, as said above"
    unnamed = Check("trials.disagree", "", "contradiction", "w", {}, "r")
    assert after_mistakes(reason, Checks.of([unnamed])) == reason
