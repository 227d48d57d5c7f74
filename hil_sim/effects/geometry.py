"""Declared constants of the robot that are not those of the robot that moves."""

from dataclasses import replace

from hil_sim.effects.entry import JOINTS, Entry, Parameter, Row
from hil_sim.errors import SimError
from hil_sim.world import TrialTruth


def declared_length_m(truth: TrialTruth, place: str) -> float:
    """What setup.toml says of the link behind this joint."""
    return truth.plant.declared_lengths_m[JOINTS.index(place)]


def _link_length(truth: TrialTruth, entry: Entry) -> TrialTruth:
    """The robot is as long as the effect says; setup.toml and the controller go on with what they believed.

    alpha stays: it is what the robot's inertia is, whatever its links measure.
    """
    length = list(truth.plant.link_lengths_m)
    for joint, value in zip(entry.joints, entry.each("length_m"), strict=True):
        if value <= 0.0:
            raise SimError(f"effect {entry.effect}: a link of {value:g} m cannot be; make it longer")
        length[joint] = value
    return replace(truth, plant=replace(truth.plant, link_lengths_m=(length[0], length[1])))


EFFECTS = (
    Row(
        "geometry.link_length",
        "the link behind the joint has this length, setup.toml declares another",
        JOINTS,
        (Parameter("length_m", "m", 0.005, 0.005, declared_length_m, signed=True),),
        _link_length,
    ),
)
