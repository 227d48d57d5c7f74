"""The result of a calibration, and what of it the board keeps.

    code = zero + S a,    S = [ gx cos(ax)   gx sin(ax) ]
                              [ -gy sin(ay)  gy cos(ay) ]

a is specific force in g along the board's axes, (2,); gx, gy are gains in codes per g; ax, ay are the angles
by which the sensor's axes are turned against the board's, counter-clockwise.
"""

import json
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Estimate:
    """A number and the half width of its 95 % interval, in the same unit."""

    value: float
    interval: float

    def __str__(self) -> str:
        return f"{self.value:.6g} ± {self.interval:.2g}"


@dataclass(frozen=True, slots=True)
class AccelerometerCalibration:
    """Offsets (codes), gains (codes per g) and angles of the sensor's axes (rad), each with its interval.

    Attributes:
        method: how it was found.
        zero_x, zero_y, gain_x, gain_y, angle_x, angle_y: see the module; where the method sees only the angle
            between the axes, angle_x is 0 with an interval of 0 and angle_y its departure from a right angle.
        residual_g: rms of what the model leaves, g.
        readings: how many positions or samples it rests on.
    """

    method: str
    zero_x: Estimate
    zero_y: Estimate
    gain_x: Estimate
    gain_y: Estimate
    angle_x: Estimate
    angle_y: Estimate
    residual_g: float
    readings: int

    def sensitivity(self) -> Floats:
        """S, codes per g, (2, 2)."""
        ax, ay = self.angle_x.value, self.angle_y.value
        gains = np.array([[self.gain_x.value], [self.gain_y.value]])
        result: Floats = gains * np.array([[np.cos(ax), np.sin(ax)], [-np.sin(ay), np.cos(ay)]])
        return result

    def specific_force(self, codes: Floats) -> Floats:
        """Codes (N, 2) to specific force along the board's axes, g, (N, 2)."""
        zero = np.array([self.zero_x.value, self.zero_y.value])
        result: Floats = np.linalg.solve(self.sensitivity(), (codes - zero).T).T
        return result

    def board_settings(self) -> dict[str, int]:
        """Settings of the board, rounded to its integers.

        Zeros in codes, gains in codes per g, angles in microradians; the intervals of the first two in
        thousandths of those, of the angles in microradians.
        """
        settings: dict[str, int] = {}
        for axis, zero, gain, angle in (
            ("X", self.zero_x, self.gain_x, self.angle_x),
            ("Y", self.zero_y, self.gain_y, self.angle_y),
        ):
            for name, number, unit, fine in (
                ("ZERO", zero, 1.0, 1e3),
                ("PER_G", gain, 1.0, 1e3),
                ("ANGLE", angle, 1e6, 1e6),
            ):
                settings[f"ACCEL_{axis}_{name}"] = round(number.value * unit)
                settings[f"ACCEL_{axis}_{name}_INTERVAL"] = round(number.interval * fine)
        return settings

    def to_json(self) -> str:
        """Readable back by `from_json`."""
        return json.dumps({"format": "impid-calibration/1", **asdict(self)}, indent=2) + "\n"

    @classmethod
    def from_json(cls, text: str) -> "AccelerometerCalibration":
        """What `to_json` wrote.

        Raises:
            ValueError: it is something else.
        """
        content = json.loads(text)
        if not isinstance(content, dict) or content.pop("format", None) != "impid-calibration/1":
            raise ValueError("not a calibration of impid")
        try:
            estimates = {name: _estimate(value) for name, value in content.items() if isinstance(value, dict)}
            return cls(**{**content, **estimates})
        except (TypeError, KeyError) as error:
            raise ValueError(f"not a whole calibration of impid ({error})") from None

    def __str__(self) -> str:
        return "\n".join(
            (
                f"{self.method}, {self.readings} readings, residual {self.residual_g * 1e3:.2f} mg rms",
                f"  zero   x {self.zero_x}   y {self.zero_y}   codes",
                f"  gain   x {self.gain_x}   y {self.gain_y}   codes per g",
                f"  angle  x {self.angle_x}   y {self.angle_y}   rad",
            )
        )


def _estimate(value: dict[str, Any]) -> Estimate:
    return Estimate(float(value["value"]), float(value["interval"]))


def from_matrix(
    method: str,
    zero: Floats,
    S: Floats,
    covariance: Floats,
    half_width: float,
    residual_g: float,
    readings: int,
) -> AccelerometerCalibration:
    """From the linear model's six numbers and their covariance, by the delta method.

    Args:
        zero: (2,), codes.
        S: (2, 2), codes per g.
        covariance: of (zero_x, Sxx, Sxy, zero_y, Syx, Syy), (6, 6).
        half_width: how many standard deviations make the 95 % interval.
    """
    gx, gy = np.hypot(*S[0]), np.hypot(*S[1])
    values = (zero[0], gx, np.arctan2(S[0, 1], S[0, 0]), zero[1], gy, np.arctan2(-S[1, 0], S[1, 1]))
    gradient = np.zeros((6, 6))
    gradient[0, 0] = gradient[3, 3] = 1.0
    gradient[1, 1:3] = S[0] / gx
    gradient[2, 1:3] = np.array([-S[0, 1], S[0, 0]]) / gx**2
    gradient[4, 4:6] = S[1] / gy
    gradient[5, 4:6] = np.array([-S[1, 1], S[1, 0]]) / gy**2
    spread = half_width * np.sqrt(np.diag(gradient @ covariance @ gradient.T))
    zx, gain_x, ax, zy, gain_y, ay = (
        Estimate(float(v), float(s)) for v, s in zip(values, spread, strict=True)
    )
    return AccelerometerCalibration(method, zx, zy, gain_x, gain_y, ax, ay, residual_g, readings)
