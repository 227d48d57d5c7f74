"""How the accelerometer errs beyond its data sheet; the sensor itself is in sensors/accelerometer.py."""

from dataclasses import replace
from typing import Any

from hil_sim.effects.entry import AXES, Entry, Parameter, Row, added
from hil_sim.sensors.accelerometer import STANDARD_GRAVITY
from hil_sim.world import TrialTruth

AXES_OR_SENSOR = (*AXES, "sensor")


def _with_sensor(truth: TrialTruth, **changes: Any) -> TrialTruth:
    return replace(truth, accelerometer=replace(truth.accelerometer, **changes))


def _misalignment(truth: TrialTruth, entry: Entry) -> TrialTruth:
    return _with_sensor(truth, mount_angle_rad=truth.accelerometer.mount_angle_rad + entry.one("angle_rad"))


def _scale(truth: TrialTruth, entry: Entry) -> TrialTruth:
    gain, error = entry.per_axis("gain", absent=1.0), truth.accelerometer.gain_error
    return _with_sensor(
        truth, gain_error=tuple((1.0 + e) * g - 1.0 for e, g in zip(error, gain, strict=True))
    )


def _bias(truth: TrialTruth, entry: Entry) -> TrialTruth:
    x, y = entry.per_axis("bias")
    mg = 1e3 / STANDARD_GRAVITY
    return _with_sensor(truth, offset_mg=added(truth.accelerometer.offset_mg, (mg * x, mg * y)))


def _cross_axis(truth: TrialTruth, entry: Entry) -> TrialTruth:
    return _with_sensor(truth, cross_axis=added(truth.accelerometer.cross_axis, entry.per_axis("cross")))


def _delay(truth: TrialTruth, entry: Entry) -> TrialTruth:
    return replace(truth, accelerometer_delay_s=truth.accelerometer_delay_s + entry.one("delay"))


def _lever_arm(truth: TrialTruth, entry: Entry) -> TrialTruth:
    return _with_sensor(truth, lever_m=added(truth.accelerometer.lever_m, entry.pair("lever")))


EFFECTS = (
    Row(
        "accel.misalignment",
        "the sensor stands turned by angle_rad, counter-clockwise",
        ("sensor",),
        (Parameter("angle_rad", "rad", 0.03, 0.03, 0.0, signed=True),),
        _misalignment,
    ),
    Row(
        "accel.scale",
        "reading = gain times specific force",
        AXES_OR_SENSOR,
        (Parameter("gain", "1", 1.03, 1.03, 1.0, signed=True),),
        _scale,
    ),
    Row(
        "accel.bias",
        "reading = specific force + bias, along the sensor's axes",
        AXES_OR_SENSOR,
        (Parameter("bias", "m/s^2", 0.1, 0.1, 0.0, signed=True),),
        _bias,
    ),
    Row(
        "accel.cross_axis",
        "an axis also reads cross times the other",
        AXES_OR_SENSOR,
        (Parameter("cross", "1", 0.03, 0.03, 0.0, signed=True),),
        _cross_axis,
    ),
    Row(
        "accel.delay",
        "reading(t) = specific force(t - delay)",
        ("sensor",),
        (Parameter("delay", "s", 0.005, 0.005, 0.0),),
        _delay,
    ),
    Row(
        "accel.lever_arm",
        "the sensor sits off the end point by lever, along its own axes",
        ("sensor",),
        (Parameter("lever", "m", 0.02, 0.02, 0.0, signed=True, pair=True),),
        _lever_arm,
    ),
)
