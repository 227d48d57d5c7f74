"""How the physical force sensor errs; the sensor itself is in sensors/force_sensor.py."""

from dataclasses import replace
from typing import Any

from hil_sim.effects.entry import AXES, Entry, Parameter, Row, added
from hil_sim.errors import SimError
from hil_sim.sensors.force_sensor import ForceSensorTruth
from hil_sim.world import TrialTruth

AXES_OR_SENSOR = ("sensor", *AXES)


def _sensor(truth: TrialTruth, entry: Entry) -> ForceSensorTruth:
    if truth.force_sensor is None:
        raise SimError(f"effect {entry.effect}: this laboratory has no force sensor; give it one")
    return truth.force_sensor


def _with_sensor(truth: TrialTruth, sensor: ForceSensorTruth, **changes: Any) -> TrialTruth:
    return replace(truth, force_sensor=replace(sensor, **changes))


def _scale(truth: TrialTruth, entry: Entry) -> TrialTruth:
    sensor, gain = _sensor(truth, entry), entry.per_axis("gain", absent=1.0)
    x, y = ((1.0 + error) * one - 1.0 for error, one in zip(sensor.gain_error, gain, strict=True))
    return _with_sensor(truth, sensor, gain_error=(x, y))


def _misalignment(truth: TrialTruth, entry: Entry) -> TrialTruth:
    sensor = _sensor(truth, entry)
    return _with_sensor(truth, sensor, angle_rad=sensor.angle_rad + entry.one("angle_rad"))


def _cross_axis(truth: TrialTruth, entry: Entry) -> TrialTruth:
    sensor = _sensor(truth, entry)
    return _with_sensor(truth, sensor, cross_axis=added(sensor.cross_axis, entry.per_axis("cross")))


def _bias(truth: TrialTruth, entry: Entry) -> TrialTruth:
    sensor = _sensor(truth, entry)
    return _with_sensor(
        truth,
        sensor,
        offset_N=added(sensor.offset_N, entry.per_axis("bias")),
        drift_N_per_s=added(sensor.drift_N_per_s, entry.per_axis("drift")),
        drift_from_s=0.5 * truth.duration_s,
    )


def _delay(truth: TrialTruth, entry: Entry) -> TrialTruth:
    sensor = _sensor(truth, entry)
    return _with_sensor(truth, sensor, delay_s=sensor.delay_s + entry.one("delay"))


def _row(name: str, says: str, places: tuple[str, ...], parameters: tuple[Parameter, ...], apply: Any) -> Row:
    return Row(name, says, places, parameters, apply, needs_force_sensor=True)


EFFECTS = (
    _row(
        "force.scale",
        "reading = gain times force",
        AXES_OR_SENSOR,
        (Parameter("gain", "1", 1.03, 1.03, 1.0, signed=True),),
        _scale,
    ),
    _row(
        "force.misalignment",
        "the sensor stands turned by angle_rad, counter-clockwise",
        ("sensor",),
        (Parameter("angle_rad", "rad", 0.03, 0.03, 0.0, signed=True),),
        _misalignment,
    ),
    _row(
        "force.cross_axis",
        "an axis also reads cross times the other",
        AXES_OR_SENSOR,
        (Parameter("cross", "1", 0.03, 0.03, 0.0, signed=True),),
        _cross_axis,
    ),
    _row(
        "force.bias",
        "reading = force + bias + drift times the time since the middle of the trial",
        AXES_OR_SENSOR,
        (
            Parameter("bias", "N", 0.2, 0.2, 0.0, signed=True),
            Parameter("drift", "N/s", 0.0, 0.01, 0.0, default=0.0, signed=True),
        ),
        _bias,
    ),
    _row(
        "force.delay",
        "reading(t) = force(t - delay)",
        ("sensor",),
        (Parameter("delay", "s", 0.005, 0.005, 0.0, signed=True),),
        _delay,
    ),
)
