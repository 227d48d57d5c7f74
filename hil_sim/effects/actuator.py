"""What stands between the logged torque and the torque at the joint."""

from dataclasses import replace

from hil_sim.effects.entry import (
    JOINTS,
    Entry,
    Parameter,
    Row,
    added,
    plant_effects,
    with_plant_effects,
    with_terms,
)
from hil_sim.plant.physics import RIPPLE, Term
from hil_sim.world import TrialTruth


def _gain(truth: TrialTruth, entry: Entry) -> TrialTruth:
    so_far, more = plant_effects(truth).gain, entry.per_joint("gain", absent=1.0)
    return with_plant_effects(truth, gain=(so_far[0] * more[0], so_far[1] * more[1]))


def _offset(truth: TrialTruth, entry: Entry) -> TrialTruth:
    return with_plant_effects(truth, offset=added(plant_effects(truth).offset, entry.per_joint("torque")))


def _cogging(truth: TrialTruth, entry: Entry) -> TrialTruth:
    columns = [entry.each(name) for name in ("amplitude", "cycles_per_rad", "phase_rad")]
    return with_terms(
        truth,
        [
            Term(RIPPLE, joint, size=amplitude, a=cycles, b=phase)
            for joint, amplitude, cycles, phase in zip(entry.joints, *columns, strict=True)
        ],
    )


def _delay(truth: TrialTruth, entry: Entry) -> TrialTruth:
    late = added(truth.log.delay_s, entry.per_joint("delay"))
    return replace(truth, log=replace(truth.log, delay_s=late))


def _lag(truth: TrialTruth, entry: Entry) -> TrialTruth:
    lag = added(plant_effects(truth).lag_s, entry.per_joint("time_constant"))
    return with_plant_effects(truth, lag_s=lag)


EFFECTS = (
    Row(
        "actuator.gain",
        "true torque = gain times logged torque",
        JOINTS,
        (Parameter("gain", "1", 1.05, 1.05, 1.0, signed=True),),
        _gain,
    ),
    Row(
        "actuator.offset",
        "logged torque = true torque + torque",
        JOINTS,
        (Parameter("torque", "N*m", 0.05, 0.05, 0.0, signed=True),),
        _offset,
    ),
    Row(
        "actuator.cogging",
        "the motor resists with amplitude sin(2 pi cycles_per_rad theta + phase)",
        JOINTS,
        (
            Parameter("amplitude", "N*m", 0.05, 0.05, 0.0),
            Parameter("cycles_per_rad", "1/rad", 2.5, 7.0),
            Parameter("phase_rad", "rad", 0.0, 6.28),
        ),
        _cogging,
    ),
    Row(
        "actuator.delay",
        "logged torque(t) = torque(t - delay)",
        JOINTS,
        (Parameter("delay", "s", 0.005, 0.005, 0.0),),
        _delay,
    ),
    Row(
        "actuator.lag",
        "the drive nears its command as exp(-t / time_constant); the log shows the command",
        JOINTS,
        (Parameter("time_constant", "s", 0.003, 0.003, 0.0),),
        _lag,
    ),
)
