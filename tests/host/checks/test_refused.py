"""A refusal of a fit does not contradict a mistake that was named before it."""

from impid_host.checks import Checks
from impid_host.checks.check import Check
from impid_host.cli.checked import after_mistakes


def test_a_refusal_ends_with_the_mistake_that_was_named() -> None:
    reason = "free trials leave open alpha1; record a free trial that moves every joint"
    named = Check("accel.axes", "sensor", "contradiction", "w", {}, "r")
    said = after_mistakes(reason, Checks.of([named]))
    assert said == "free trials leave open alpha1; mend accel.axes@sensor first, as said above"
    unnamed = Check("trials.disagree", "", "contradiction", "w", {}, "r")
    assert after_mistakes(reason, Checks.of([unnamed])) == reason
