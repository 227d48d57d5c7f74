"""What goes wrong with the accelerometer, read off its map against the accelerations of the encoders."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from impid_host.checks.axes import AxisMap, axis_map, corrected
from impid_host.checks.check import Change
from impid_host.checks.equations import Motions, low, turned
from impid_host.checks.factors import Factor
from impid_host.checks.mistakes.hypothesis import Hypothesis
from impid_host.checks.signals import Signals
from impid_host.signals.arrays import Floats
from impid_host.study.model import STANDARD_GRAVITY_M_S2, AccelerometerSetup

Mount = Literal["link2", "fixed"]
MOUNTS: tuple[Mount, ...] = ("link2", "fixed")


def acceleration_map(study: Signals, motions: Motions, mount: Mount) -> AxisMap | None:
    """How the readings lie to what the encoders say the sensor feels, mounted so."""
    reading, expected = [], []
    for trial in study.trials:
        motion = motions.of(trial, study)
        if trial.acceleration is not None and motion.felt is not None:
            reading.append(low(trial.acceleration))
            expected.append(turned(motion.felt[mount], -study.mount_angle))
    return axis_map(np.concatenate(reading), np.concatenate(expected)) if reading else None


def hypotheses(study: Signals, motions: Motions, sensor: AccelerometerSetup | None) -> Iterator[Hypothesis]:
    """Another place, another unit, another frame of the sensor."""
    if sensor is None:
        return
    for mount in MOUNTS:
        found = acceleration_map(study, motions, mount)
        if found is not None and found.is_map and (found.off or mount != study.mount):
            yield _mistake(_Case(study, sensor, mount, found))


@dataclass(frozen=True, slots=True)
class _Case:
    study: Signals
    sensor: AccelerometerSetup
    mount: Mount
    found: AxisMap


def _mistake(case: _Case) -> Hypothesis:
    found, study = case.found, case.study
    angle = float(np.remainder(study.mount_angle + found.turn + np.pi, 2 * np.pi) - np.pi)
    words, changes, what = [], [], "accel.unit"
    if any(gain is not None for gain in found.gains):
        said, keys = _unit(case)
        words.append(said)
        changes += keys
    if found.mirrored or found.turn != 0:
        what = "accel.axes"
        words.append(_axes_words(found))
        if found.turn != 0:
            changes.append(Change("accelerometer", "mount_angle_rad", round(angle, 4)))
        if found.mirrored:
            changes = _mirrored(case.sensor, changes, swapped=_swapped(found))
    if case.mount != study.mount:
        what = "accel.mount"
        words.append("it turns with link 2" if case.mount == "link2" else "its axes stay along x and y")
        changes.append(Change("accelerometer", "mount", case.mount))

    swapped = _swapped(found)

    def mend(signals: Signals) -> Signals:
        mended = signals.mapped(
            acceleration=lambda values: corrected(
                _other_axis(values, case.sensor) if swapped else values, found
            )
        )
        return replace(mended, mount=case.mount)

    listed = ", ".join(f"{change.key} = {_toml(change.value)}" for change in changes)
    return Hypothesis(
        what,
        _where(found) if what == "accel.unit" else "sensor",
        "the accelerometer is not as declared: " + "; ".join(words),
        mend,
        f"setup.toml: [accelerometer] {listed}",
        tuple(changes),
        odds=0.0 if case.mount == study.mount else 0.5,
    )


def _swapped(found: AxisMap) -> bool:
    """The readings are each other's, so that each was given the other's zero and sensitivity."""
    return found.mirrored and abs(abs(found.turn) - np.pi / 2) < 1e-6


def _other_axis(values: Floats, sensor: AccelerometerSetup) -> Floats:
    """Specific force (N, 2) with each axis' zero and sensitivity given to the other."""
    zero, s = np.array(sensor.zero_g_V), np.array(sensor.sensitivity_V_per_g)
    volts = values / STANDARD_GRAVITY_M_S2 * s + zero
    result: Floats = (volts - zero[::-1]) / s[::-1] * STANDARD_GRAVITY_M_S2
    return result


def _where(found: AxisMap) -> str:
    off = [axis for axis, gain in zip("xy", found.gains, strict=True) if gain is not None]
    return "sensor" if len(off) == 2 else off[0]


def _axes_words(found: AxisMap) -> str:
    degrees = np.rad2deg(found.turn)
    if not found.mirrored:
        return f"its axes are turned by {degrees:.0f} degrees"
    quarter = round(degrees / 90) % 4
    return {
        0: "its second axis points the other way",
        1: "its two axes are swapped",
        2: "its first axis points the other way",
        3: "its two axes are swapped and turned over",
    }[quarter]


def _unit(case: _Case) -> tuple[str, list[Change]]:
    """The key that explains the gains; a wrong reference voltage also shifts the zeros."""
    first, second = case.found.gains
    sensor = case.sensor
    if first is None or second is None or abs(first.value / second.value - 1) > 0.05:
        scale = [1.0 if gain is None else gain.value for gain in (first, second)]
        new = [float(f"{s * k:.6g}") for s, k in zip(sensor.sensitivity_V_per_g, scale, strict=True)]
        said = ", ".join(_words(gain) for gain in (first, second))
        return f"its two axes read {said} times too much", [
            Change("accelerometer", "sensitivity_V_per_g", new)
        ]
    k = first.value
    said = f"it reads {first.words} times too much"
    by_reference, by_sensitivity = _biases(case, k)
    if by_reference < by_sensitivity:
        if 2 ** round(np.log2(k)) / k > 0.96 and abs(np.log2(k) - round(np.log2(k))) < 0.05 and abs(k) > 3.5:
            return said, [Change("accelerometer", "full_scale_code", round(sensor.full_scale_code * k))]
        return said, [Change("accelerometer", "vref_V", float(f"{sensor.vref_V / k:.4g}"))]
    new = [float(f"{s * k:.6g}") for s in sensor.sensitivity_V_per_g]
    return said, [Change("accelerometer", "sensitivity_V_per_g", new)]


def _biases(case: _Case, k: float) -> tuple[float, float]:
    """What would be left of the bias (g) with a reference, or with sensitivities, k times as large."""
    zero, s = np.array(case.sensor.zero_g_V), np.array(case.sensor.sensitivity_V_per_g)
    bias = case.found.bias / STANDARD_GRAVITY_M_S2
    volts = bias * s + zero
    return float(np.abs((volts / k - zero) / s).max()), float(np.abs(bias / k).max())


def _words(gain: Factor | None) -> str:
    return "1" if gain is None else gain.words


def _mirrored(sensor: AccelerometerSetup, changes: list[Change], *, swapped: bool) -> list[Change]:
    """The second axis turned round by the sign of its sensitivity, whatever else is changed of it."""
    given = next((c for c in changes if c.key == "sensitivity_V_per_g"), None)
    values = list(sensor.sensitivity_V_per_g) if given is None else list(given.value)
    rest = [c for c in changes if c.key != "sensitivity_V_per_g"]
    if swapped:
        values.reverse()
        rest.append(Change("accelerometer", "zero_g_V", list(sensor.zero_g_V[::-1])))
    values[1] = -values[1]
    return [*rest, Change("accelerometer", "sensitivity_V_per_g", values)]


def _toml(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else str(value)
