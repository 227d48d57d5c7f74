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
)
