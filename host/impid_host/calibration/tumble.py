"""Calibration by gravity: the board stands upright in several positions, at rest.

At rest specific force is 1 g upwards, so in the board's plane a = (cos p, sin p) with p the angle from the
board's x axis to the vertical. Where the angles are known (a dividing head) every number of the model
follows. Where they are not, the readings lie on an ellipse whose centre, axes and shear are the zeros, the
gains and the angle between the sensor's axes; how both are turned against the board stays unknown.
"""

import numpy as np

from impid_host.calibration.accelerometer import AccelerometerCalibration, Estimate, Floats, from_matrix
from impid_host.errors import UndeterminedError
from impid_host.signals.quantiles import student_975

FEWEST_POSITIONS = 6
# Readings within less than this part of the circle leave centre and radius to chance.
_LARGEST_GAP_RAD = 2.4
_WORST_GAIN_INTERVAL = 0.05


def calibrate_by_angles(codes: Floats, angle_rad: Floats) -> AccelerometerCalibration:
    """Zeros, gains and both axes' angles from positions at known angles, by linear least squares.

    Args:
        codes: mean reading of each position, (K, 2).
        angle_rad: from the board's x axis to the vertical, (K,).

    Raises:
        UndeterminedError: fewer than six positions, or they lie on one side.
    """
    _check_spread(np.asarray(angle_rad, dtype=np.float64))
    K = len(angle_rad)
    design = np.column_stack([np.ones(K), np.cos(angle_rad), np.sin(angle_rad)])
    solution, *_ = np.linalg.lstsq(design, codes, rcond=None)
    residual = codes - design @ solution
    freedom = K - 3
    inverse = np.linalg.inv(design.T @ design)
    covariance = np.zeros((6, 6))
    for axis in range(2):
        part = slice(3 * axis, 3 * axis + 3)
        covariance[part, part] = inverse * (residual[:, axis] @ residual[:, axis]) / freedom
    S = solution[1:].T
    rms_g = float(np.sqrt(np.mean(np.linalg.solve(S, residual.T) ** 2)))
    half_width = float(student_975(freedom))
    return from_matrix("tumble at known angles", solution[0], S, covariance, half_width, rms_g, K)


def calibrate_by_circle(codes: Floats) -> AccelerometerCalibration:
    """Zeros, gains and the angle between the axes from positions at unknown angles.

    Each reading turned back into g must have the length 1: one equation a position, five unknowns.

    Args:
        codes: mean reading of each position, (K, 2).

    Raises:
        UndeterminedError: fewer than six positions, they lie on one side, or they fit no ellipse.
    """
    codes = np.asarray(codes, dtype=np.float64)
    if len(codes) < FEWEST_POSITIONS:
        raise UndeterminedError(_too_few(len(codes)))
    middle = (codes.max(axis=0) + codes.min(axis=0)) / 2
    gains = (codes.max(axis=0) - codes.min(axis=0)) / 2
    from scipy import optimize  # noqa: PLC0415  (a fifth of a second)

    fit = optimize.least_squares(
        _length_error, [*middle, *gains, 0.0], args=(codes,), x_scale=[*gains, *gains, 0.1], method="lm"
    )
    zx, zy, gx, gy, shear = fit.x
    turned_back = _turned_back(fit.x, codes)
    _check_spread(np.arctan2(turned_back[:, 1], turned_back[:, 0]))
    freedom = len(codes) - 5
    jacobian = np.asarray(fit.jac)
    covariance = np.linalg.inv(jacobian.T @ jacobian) * (fit.fun @ fit.fun) / freedom
    spread = float(student_975(freedom)) * np.sqrt(np.diag(covariance))
    if not fit.success or max(spread[2] / gx, spread[3] / gy) > _WORST_GAIN_INTERVAL:
        raise UndeterminedError(
            "the positions do not fit one circle of 1 g; hold the board upright and still in each of them"
        )
    zero_x, zero_y, gain_x, gain_y, angle_y = (
        Estimate(float(value), float(s)) for value, s in zip((zx, zy, gx, gy, shear), spread, strict=True)
    )
    return AccelerometerCalibration(
        "tumble",
        zero_x,
        zero_y,
        gain_x,
        gain_y,
        Estimate(0.0, 0.0),
        angle_y,
        float(np.sqrt(np.mean(fit.fun**2))),
        len(codes),
    )


def _turned_back(parameters: Floats, codes: Floats) -> Floats:
    zx, zy, gx, gy, shear = parameters
    first = (codes[:, 0] - zx) / gx
    second = ((codes[:, 1] - zy) / gy + np.sin(shear) * first) / np.cos(shear)
    return np.stack([first, second], axis=1)


def _length_error(parameters: Floats, codes: Floats) -> Floats:
    result: Floats = np.linalg.norm(_turned_back(parameters, codes), axis=1) - 1.0
    return result


def _check_spread(angle_rad: Floats) -> None:
    if len(angle_rad) < FEWEST_POSITIONS:
        raise UndeterminedError(_too_few(len(angle_rad)))
    around = np.sort(np.mod(angle_rad, 2 * np.pi))
    gaps = np.diff(np.append(around, around[0] + 2 * np.pi))
    if gaps.max() > _LARGEST_GAP_RAD:
        raise UndeterminedError(
            f"the positions leave {np.degrees(gaps.max()):.0f} degrees of the circle empty; "
            "spread them all round"
        )


def _too_few(count: int) -> str:
    return f"{count} positions do not determine a calibration; it takes {FEWEST_POSITIONS}, spread all round"
