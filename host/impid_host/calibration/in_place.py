"""Calibration where the board is mounted: the motion that the encoders saw against what the sensor read.

Both sides pass the same low-pass filter, so that it drops out. The residual hangs together over time (the
robot's flexibility, the filter), so the intervals are those of blocks, not of samples (cluster-robust,
Liang & Zeger 1986).
"""

import numpy as np

from impid_host.calibration.accelerometer import AccelerometerCalibration, Floats, from_matrix
from impid_host.errors import UndeterminedError
from impid_host.signals.filters import ZeroPhaseLowPass
from impid_host.signals.quantiles import student_975

CUTOFF_HZ = 10.0
BLOCK_S = 1.0
_FEWEST_BLOCKS = 10
_WORST_GAIN_INTERVAL = 0.1


def second_derivative(values: Floats, rate_hz: float) -> Floats:
    """d2/dt2 along axis 0 by the five-point formula (error of fourth order); the two ends are repeated."""
    inner = (-values[:-4] + 16 * values[1:-3] - 30 * values[2:-2] + 16 * values[3:-1] - values[4:]) / 12
    result: Floats = np.concatenate([inner[:1], inner[:1], inner, inner[-1:], inner[-1:]]) * rate_hz**2
    return result


def calibrate_in_place(codes: Floats, predicted_g: Floats, rate_hz: float) -> AccelerometerCalibration:
    """Zeros, gains and both axes' angles from a motion.

    Args:
        codes: readings, (N, 2).
        predicted_g: specific force along the board's axes that the encoders imply, unfiltered, g, (N, 2).
        rate_hz: of the rows.

    Raises:
        UndeterminedError: too short, or the motion does not determine both gains to 10 %.
    """
    block, edge = int(BLOCK_S * rate_hz), int(rate_hz / CUTOFF_HZ * 3)
    blocks = (len(codes) - 2 * edge) // block
    if blocks < _FEWEST_BLOCKS:
        raise UndeterminedError(
            f"{len(codes) / rate_hz:.1f} s of motion do not determine a calibration; it takes "
            f"{_FEWEST_BLOCKS * BLOCK_S + 2 * edge / rate_hz:.0f} s"
        )
    low_pass = ZeroPhaseLowPass(order=2, cutoff_hz=CUTOFF_HZ)
    rows = slice(edge, edge + blocks * block)
    y = low_pass.apply(codes.astype(np.float64), rate_hz)[rows]
    a = low_pass.apply(predicted_g, rate_hz)[rows]
    design = np.column_stack([np.ones(len(a)), a])
    normal = design.T @ design
    if np.linalg.cond(normal) > 1e10:
        raise UndeterminedError(
            "the motion does not accelerate the board along both axes; move it in all directions"
        )
    solution = np.linalg.solve(normal, design.T @ y)
    residual = y - design @ solution
    covariance = _between_blocks(design, residual, blocks)
    S = solution[1:].T
    rms_g = float(np.sqrt(np.mean(np.linalg.solve(S, residual.T) ** 2)))
    half_width = float(student_975(blocks - 3))
    found = from_matrix(
        "in place against the encoders", solution[0], S, covariance, half_width, rms_g, len(codes)
    )
    for gain in (found.gain_x, found.gain_y):
        if gain.interval > _WORST_GAIN_INTERVAL * gain.value:
            raise UndeterminedError(
                f"the motion determines a gain only to {gain} codes per g; move faster, and longer"
            )
    return found


def _between_blocks(design: Floats, residual: Floats, blocks: int) -> Floats:
    """Covariance of both axes' coefficients, (6, 6), from the scores of the blocks."""
    p = design.shape[1]
    scores = np.stack([design * residual[:, [axis]] for axis in range(2)], axis=1).reshape(blocks, -1, 2 * p)
    of_block = scores.sum(axis=1)
    inverse = np.kron(np.eye(2), np.linalg.inv(design.T @ design))
    result: Floats = inverse @ (of_block.T @ of_block) @ inverse * blocks / (blocks - p)
    return result
