"""A calibration applied: which numbers of setup.toml's [accelerometer] it replaces, and where one is found.

A recording carries the calibration that `record --calibration` was given and the settings of its board, among
them the calibration that `device calibrate --save` stored there. The first goes before the second.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from impid_host.calibration.accelerometer import AccelerometerCalibration, Estimate
from impid_host.errors import InputError
from impid_host.recording import channels
from impid_host.study.model import AccelerometerSetup, Setup

if TYPE_CHECKING:
    from impid_host.recording.reader import Recording

_NUMBERS = ("zero_x", "zero_y", "gain_x", "gain_y", "angle_x", "angle_y")
_SETTING = {"zero": ("zero", 1.0, 1e3), "gain": ("per_g", 1.0, 1e3), "angle": ("angle", 1e6, 1e6)}


@dataclass(frozen=True, slots=True)
class FoundCalibration:
    """A calibration and where it was found, in words."""

    calibration: AccelerometerCalibration
    source: str


def calibrated(accelerometer: AccelerometerSetup, found: AccelerometerCalibration) -> AccelerometerSetup:
    """The sensor with measured zeros, gains and axis angles in place of the data sheet's."""
    volts_per_code = accelerometer.vref_V / accelerometer.full_scale_code
    return replace(
        accelerometer,
        zero_g_V=(found.zero_x.value * volts_per_code, found.zero_y.value * volts_per_code),
        sensitivity_V_per_g=(found.gain_x.value * volts_per_code, found.gain_y.value * volts_per_code),
        axis_angles_rad=(found.angle_x.value, found.angle_y.value),
    )


def with_calibration(setup: Setup, recordings: "Sequence[Recording]") -> tuple[Setup, str]:
    """The apparatus with the calibration that the recordings carry, and what was done in words ("": nothing).

    Raises:
        InputError: the recordings carry different ones.
    """
    found = [(recording.path, recorded_calibration(recording.metadata)) for recording in recordings]
    path, first = found[0]
    for other_path, other in found[1:]:
        if _numbers(other) != _numbers(first):
            remedy = "export recordings of one calibration, or say which one holds with --calibration"
            raise InputError(other_path, f"carries another calibration than {path}", remedy)
    return (setup, "") if first is None else apply(setup, first, path)


def apply(setup: Setup, found: FoundCalibration, path: Path) -> tuple[Setup, str]:
    """The apparatus with this calibration of `path`, and what was done, in words.

    Raises:
        InputError: the setup describes no accelerometer whose codes it could explain.
    """
    if setup.accelerometer is None or not setup.accelerometer.reads_codes:
        remedy = (
            "add [accelerometer] with vref_V, full_scale_code, zero_g_V and sensitivity_V_per_g to the setup"
        )
        raise InputError(
            path, "is a calibration, but the setup describes no accelerometer by its codes", remedy
        )
    now = calibrated(setup.accelerometer, found.calibration)
    zero, gain = now.zero_g_V, now.sensitivity_V_per_g
    words = (
        f"accelerometer as calibrated ({found.source}): zero {zero[0]:.4f}, {zero[1]:.4f} V, "
        f"sensitivity {gain[0]:.4f}, {gain[1]:.4f} V/g, axes turned by {now.axis_angles_rad[0] * 1e3:+.2f}, "
        f"{now.axis_angles_rad[1] * 1e3:+.2f} mrad, in place of the setup's numbers"
    )
    return replace(setup, accelerometer=now), words


def recorded_calibration(metadata: Mapping[str, Mapping[str, str]]) -> FoundCalibration | None:
    """The calibration that a recording's metadata carry; None where there is none, or a damaged one."""
    try:
        return _given(metadata.get(channels.METADATA_CALIBRATION, {})) or _of_board(
            metadata.get(channels.METADATA_SETTINGS, {})
        )
    except (KeyError, ValueError):
        return None


def read_calibration(path: Path) -> FoundCalibration:
    """A file that `device calibrate` has written.

    Raises:
        InputError: it cannot be read, or is something else.
    """
    try:
        found = AccelerometerCalibration.from_json(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check the name") from None
    except ValueError as error:
        remedy = "give a file that `impid-host device calibrate` has written"
        raise InputError(path, str(error), remedy) from None
    return FoundCalibration(found, f"{found.method}, {path}")


def as_metadata(found: AccelerometerCalibration) -> dict[str, str]:
    """The flat texts in which a recording keeps a calibration; `recorded_calibration` reads them back."""
    texts = {"method": found.method, "residual_g": repr(found.residual_g), "readings": str(found.readings)}
    for name in _NUMBERS:
        number: Estimate = getattr(found, name)
        texts |= {f"{name}_value": repr(number.value), f"{name}_interval": repr(number.interval)}
    return texts


def _given(texts: Mapping[str, str]) -> FoundCalibration | None:
    if not texts:
        return None
    numbers = {
        name: Estimate(float(texts[f"{name}_value"]), float(texts[f"{name}_interval"])) for name in _NUMBERS
    }
    method = texts["method"]
    found = AccelerometerCalibration(
        method=method,
        residual_g=float(texts["residual_g"]),
        readings=int(texts.get("readings", "0")),
        **numbers,
    )
    return FoundCalibration(found, f"{method}, given to the recording")


def _of_board(settings: Mapping[str, str]) -> FoundCalibration | None:
    """What the board keeps; a board that was never calibrated keeps typical values with intervals of zero."""
    numbers = {}
    for name in _NUMBERS:
        kind, axis = name.split("_")
        setting, unit, fine = _SETTING[kind]
        key = f"accel_{axis}_{setting}"
        if key not in settings:
            return None
        interval = int(settings[f"{key}_interval"]) / fine
        numbers[name] = Estimate(int(settings[key]) / unit, interval)
    if all(number.interval == 0.0 for number in numbers.values()):
        return None
    found = AccelerometerCalibration("as stored on the board", residual_g=0.0, readings=0, **numbers)
    return FoundCalibration(found, "as stored on the board")


def _numbers(found: FoundCalibration | None) -> tuple[float, ...] | None:
    return None if found is None else tuple(getattr(found.calibration, name).value for name in _NUMBERS)
