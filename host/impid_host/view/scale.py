"""From what the board sends to what a person reads: m/s² and rad, per axis and joint."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impid_host.robot.model import robot_model
from impid_host.signals.arrays import Floats
from impid_host.study.model import STANDARD_GRAVITY_M_S2, Setup

_SIXTEEN_BITS = 65536


@dataclass(frozen=True, slots=True)
class Scale:
    """Two axes of acceleration and two encoders; value = zero + gain * (raw - raw_zero).

    Attributes:
        acc_zero: code at rest without gravity, per axis; acc_gain: m/s² per code.
        angle_zero: angle at count 0, per encoder; angle_gain: angle per count.
        angle_units: "rad", "m" for a sliding joint, or "counts" where nothing says what a count is.
        source: where the numbers come from, in words.
    """

    acc_zero: tuple[float, float]
    acc_gain: tuple[float, float]
    angle_zero: tuple[float, float]
    angle_gain: tuple[float, float]
    angle_units: tuple[str, str]
    source: str

    def acceleration(self, codes: NDArray[Any]) -> Floats:
        """Codes (N, 2) -> specific force along the sensor's axes, m/s², (N, 2)."""
        result: Floats = (np.asarray(codes, dtype=np.float64) - self.acc_zero) * self.acc_gain
        return result

    def angles(self, counts: NDArray[Any]) -> Floats:
        """Counts (N, 2) -> angles in `angle_units`, (N, 2)."""
        result: Floats = np.asarray(counts, dtype=np.float64) * self.angle_gain + self.angle_zero
        return result

    def to_dict(self) -> dict[str, Any]:
        """For the pipe to the serving process."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> "Scale":
        """What `to_dict` gave, lists in place of tuples."""
        plain: dict[str, Any] = {name: tuple(v) if isinstance(v, list) else v for name, v in values.items()}
        return cls(**plain)


def scale_of(setup: Setup | None, settings: Mapping[str, int], full_scale_code: int) -> Scale:
    """The apparatus' numbers where a setup gives them, else those that the board keeps itself.

    Args:
        settings: the board's, by name; zero and gain in codes of 16 bits.
        full_scale_code: of the codes that the board sends.
    """
    own = full_scale_code / _SIXTEEN_BITS
    zero = (own * settings.get("accel_x_zero", 32768), own * settings.get("accel_y_zero", 32768))
    per_g = (own * settings.get("accel_x_per_g", 12233), own * settings.get("accel_y_per_g", 12233))
    turns = (settings.get("encoder_1_cpr", 0), settings.get("encoder_2_cpr", 0))
    scale = Scale(
        acc_zero=zero,
        acc_gain=(STANDARD_GRAVITY_M_S2 / per_g[0], STANDARD_GRAVITY_M_S2 / per_g[1]),
        angle_zero=(0.0, 0.0),
        angle_gain=(_per_count(turns[0]), _per_count(turns[1])),
        angle_units=("rad" if turns[0] else "counts", "rad" if turns[1] else "counts"),
        source="the board's settings",
    )
    return scale if setup is None else _of_setup(setup, scale)


def _per_count(counts_per_turn: float) -> float:
    return 2 * np.pi / counts_per_turn if counts_per_turn else 1.0


def _of_setup(setup: Setup, scale: Scale) -> Scale:
    values: dict[str, Any] = scale.to_dict() | {"source": "setup.toml"}
    sensor, encoder = setup.accelerometer, setup.encoder
    if sensor is not None and sensor.reads_codes:
        codes_per_V = sensor.full_scale_code / sensor.vref_V
        values["acc_zero"] = tuple(zero * codes_per_V for zero in sensor.zero_g_V)
        values["acc_gain"] = tuple(
            STANDARD_GRAVITY_M_S2 / (gain * codes_per_V) for gain in sensor.sensitivity_V_per_g
        )
    if encoder is not None:
        slides = robot_model(setup.robot).prismatic
        for k in range(min(2, len(encoder.counts_per_rev))):
            gain = encoder.direction[k] * _per_count(encoder.counts_per_rev[k])
            unit = "m" if k < len(slides) and slides[k] else "rad"
            for name, value in (("gain", gain), ("zero", encoder.zero_rad[k]), ("units", unit)):
                pair = list(values[f"angle_{name}"])
                pair[k] = value
                values[f"angle_{name}"] = tuple(pair)
    return Scale(**values)
