"""How the encoders err: board, log and controller read the same discs."""

from dataclasses import replace
from typing import Any

from hil_sim.effects.entry import JOINTS, Entry, Parameter, Row, added
from hil_sim.world import TrialTruth


def _with_encoders(truth: TrialTruth, **changes: Any) -> TrialTruth:
    return replace(truth, encoder=replace(truth.encoder, **changes), plant=replace(truth.plant, **changes))


def _eccentricity(truth: TrialTruth, entry: Entry) -> TrialTruth:
    return _with_encoders(
        truth, once_per_turn_rad=entry.per_joint("amplitude_rad"), phase_rad=entry.per_joint("phase_rad")
    )


def _zero(truth: TrialTruth, entry: Entry) -> TrialTruth:
    return _with_encoders(truth, shift_rad=added(truth.encoder.shift_rad, entry.per_joint("zero_rad")))


def _scale(truth: TrialTruth, entry: Entry) -> TrialTruth:
    """Fewer counts than declared make a turn where the factor is above one."""
    factor = entry.per_joint("factor", absent=1.0)
    if entry.values["believed_by"] == "setup":
        so_far = truth.board_factor
        return replace(truth, board_factor=(so_far[0] * factor[0], so_far[1] * factor[1]))
    so_far = truth.encoder.factor
    return _with_encoders(truth, factor=(so_far[0] * factor[0], so_far[1] * factor[1]))


EFFECTS = (
    Row(
        "encoder.eccentricity",
        "reading = theta + amplitude sin(theta + phase)",
        JOINTS,
        (Parameter("amplitude_rad", "rad", 0.02, 0.02, 0.0), Parameter("phase_rad", "rad", 0.0, 6.28)),
        _eccentricity,
    ),
    Row(
        "encoder.zero",
        "reading = theta + zero_rad",
        JOINTS,
        (Parameter("zero_rad", "rad", 0.02, 0.02, 0.0, signed=True),),
        _zero,
    ),
    Row(
        "encoder.scale",
        "true angle from count 0 = factor times the declared one; the wrong counts per turn are believed by"
        " everybody, or by setup alone, so that the robot's own log is right",
        JOINTS,
        (
            Parameter("factor", "1", 1.01, 1.01, 1.0, signed=True),
            Parameter("believed_by", "", default="everybody", words=("everybody", "setup")),
        ),
        _scale,
    ),
)
