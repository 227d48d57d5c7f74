"""What the papers' model leaves of a trial, as its laboratory would compute it, with the true parameters.

Low-passed at 4.5 Hz as in [D] Sec. III-A. For pictures, and for the
strength of effects.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from hil_sim.sensors.accelerometer import STANDARD_GRAVITY
from hil_sim.sensors.adc import CONVERSIONS
from hil_sim.world import TICK_US, TrialTruth, World

Array = NDArray[np.float64]
PASS_HZ = 4.5
WIDE_HZ = 60.0
EDGE_S = 2.0  # left out at both ends
EVERY = 20  # of the samples: 50 Hz hold all that passes
BLOCK = 1000
# Mean of the conversions of one tick, and the sensor's own filter.
LATE_S = 0.5e-6 * (CONVERSIONS - 1) * TICK_US / CONVERSIONS


@dataclass(frozen=True)
class Residuals:
    """What the papers' model leaves of one trial, and what its parameters could take up.

    Attributes:
        channel: values per channel, each shape (n,): tau1, tau2 (N m) in free trials; fx, fy, and with a
            force sensor fsx, fsy (N) in loaded ones; a1, a2 (m/s^2), the accelerometer against the
            encoders along its axes.
        columns: what the model's parameters can do: for tau1 and tau2 stacked, shape (2 n, 5); for fx and fy
            stacked, shape (2 n, 6).
    """

    channel: dict[str, Array]
    columns: Array


def residuals(truth: TrialTruth, nominal: TrialTruth) -> Residuals:
    """Residuals of a trial that is `truth`, for a laboratory that believes `nominal`."""
    s = _signals(truth, nominal)
    alpha, load = nominal.plant.alpha, nominal.plant.load
    regressor = _robot_regressor(s["q"], s["w"], s["a"])
    missing = s["tau"] - regressor @ np.array(alpha)
    channel: dict[str, Array] = {}
    felt = _low(s["specific"] - s["specific_encoder"])
    if not load.M.any() and not load.K.any():
        tau = _low(missing)
        channel |= {"tau1": tau[:, 0], "tau2": tau[:, 1]}
        columns = np.concatenate([_low(regressor[:, j]) for j in (0, 1)])
    else:
        virtual = np.linalg.solve(np.swapaxes(s["J"], 1, 2), -missing[:, :, None])[:, :, 0]
        d = s["x"] - load.x0
        model = -(s["acc"] @ load.M.T + s["v"] @ load.B.T + d @ load.K.T)
        force = _low(virtual - model)
        channel |= {"fx": force[:, 0], "fy": force[:, 1]}
        if "force" in s:
            sensor = _low(virtual - s["force"])
            channel |= {"fsx": sensor[:, 0], "fsy": sensor[:, 1]}
        columns = _load_columns(s["acc"], d)
    channel |= {"a1": felt[:, 0], "a2": felt[:, 1]}
    return Residuals(channel, columns)


def causes(truth: TrialTruth, nominal: TrialTruth) -> dict[str, Array]:
    """What a residual may be drawn against, at the same instants, each shape (n, 2).

    Returns:
        Angles q (rad), speeds w (rad/s), place x (m), its velocity v (m/s) and acceleration acc (m/s^2), the
        model's torque tau (N m), the load's force by its model (N), and the specific force that the encoders
        let expect along the sensor's axes (m/s^2).
    """
    s = _signals(truth, nominal)
    s["tau"] = _robot_regressor(s["q"], s["w"], s["a"]) @ np.array(nominal.plant.alpha)
    load = nominal.plant.load
    s["force"] = -(s["acc"] @ load.M.T + s["v"] @ load.B.T + (s["x"] - load.x0) @ load.K.T)
    names = {
        "q": "q",
        "w": "w",
        "x": "x",
        "v": "v",
        "acc": "acc",
        "tau": "tau",
        "force": "force",
        "specific": "specific_encoder",
    }
    return {name: _low(s[signal]) for name, signal in names.items()}


def _low(values: Array) -> Array:
    """Low-passed at 4.5 Hz without phase, thinned out, without the ends; time along axis 0."""
    smooth = sosfiltfilt(butter(5, PASS_HZ, fs=1e6 / TICK_US, output="sos"), values, axis=0)
    edge = round(EDGE_S * 1e6 / TICK_US)
    return np.asarray(smooth[edge:-edge:EVERY])


def _signals(truth: TrialTruth, nominal: TrialTruth) -> dict[str, Array]:
    """What the laboratory would compute from its sensors, at the board's ticks."""
    world = World(truth)
    world.begin(0)
    adc, counts, rows = [], [], []
    first = TICK_US * CONVERSIONS
    while not world.log_complete:
        readings = world.read(first, BLOCK)
        first += TICK_US * BLOCK
        adc.append(readings.adc.mean(axis=1))
        counts.append(readings.encoder)
        rows += world.take_log()
    count = sum(part.shape[0] for part in counts)
    since_s = 1e-6 * (TICK_US * CONVERSIONS + TICK_US * np.arange(count))
    clock, board = truth.robot_clock, 1.0 + 1e-6 * truth.board_rate_ppm
    robot_s = clock.zero_s + since_s * clock.rate / board
    t_log = np.concatenate([part.t_s for part in rows])
    inside = (robot_s > t_log[0]) & (robot_s < t_log[-1])
    sensor = nominal.accelerometer
    volts = np.concatenate(adc) / (1 << 12) * (sensor.nominal_supply_V or sensor.supply_V)
    specific = (volts - np.array(sensor.zero_g_V)) / np.array(sensor.sensitivity_V_per_g) * STANDARD_GRAVITY
    late = LATE_S + 1.0 / (2.0 * np.pi * sensor.bandwidth_Hz)
    specific = np.stack([np.interp(since_s + late, since_s, column) for column in specific.T], axis=1)

    def logged(name: str) -> Array:
        table = np.concatenate([getattr(part, name) for part in rows])
        return np.stack([np.interp(robot_s[inside], t_log, column) for column in table.T], axis=1)

    q = nominal.encoder.angle(np.concatenate(counts))[inside]
    signals = {"q": q, "tau": logged("tau_Nm")}
    if rows[0].force_N is not None:
        signals["force"] = logged("force_N")
    return signals | _kinematics(q, specific[inside], nominal)


def _kinematics(q: Array, specific: Array, nominal: TrialTruth) -> dict[str, Array]:
    """Speeds, place, Jacobian, and accelerations by the accelerometer and by the encoders."""
    dt = 1e-6 * TICK_US
    wide = butter(4, WIDE_HZ, fs=1.0 / dt, output="sos")
    smooth = np.asarray(sosfiltfilt(wide, q, axis=0))
    w = np.gradient(smooth, dt, axis=0)
    w_rate = np.gradient(w, dt, axis=0)
    l1, l2 = nominal.plant.link_lengths_m
    s, c = np.sin(smooth), np.cos(smooth)
    J = np.stack([[-l1 * s[:, 0], l2 * c[:, 1]], [l1 * c[:, 0], l2 * s[:, 1]]]).transpose(2, 0, 1)
    # J' w: each link's end is pulled towards its axis.
    pull = np.stack([l1 * w[:, 0] ** 2, l2 * w[:, 1] ** 2], axis=1)
    bend = np.stack(
        [-c[:, 0] * pull[:, 0] - s[:, 1] * pull[:, 1], -s[:, 0] * pull[:, 0] + c[:, 1] * pull[:, 1]], axis=1
    )
    angle = nominal.accelerometer.mount_angle_rad + (
        smooth[:, 1] if nominal.accelerometer.turns_with_link2 else 0.0
    )
    cosine, sine = np.cos(angle), np.sin(angle)
    acc = np.stack(
        [cosine * specific[:, 0] - sine * specific[:, 1], sine * specific[:, 0] + cosine * specific[:, 1]],
        axis=1,
    )
    by_encoders = np.einsum("nij,nj->ni", J, w_rate) + bend
    expected = np.stack(
        [
            cosine * by_encoders[:, 0] + sine * by_encoders[:, 1],
            cosine * by_encoders[:, 1] - sine * by_encoders[:, 0],
        ],
        axis=1,
    )
    return {
        "specific": specific,
        "specific_encoder": expected,
        "w": w,
        "x": np.stack([J[:, 1, 0] + J[:, 1, 1], -J[:, 0, 0] - J[:, 0, 1]], axis=1),
        "v": np.einsum("nij,nj->ni", J, w),
        "J": J,
        "acc": acc,
        "a": np.linalg.solve(J, (acc - bend)[:, :, None])[:, :, 0],
    }


def _robot_regressor(q: Array, w: Array, a: Array) -> Array:
    """tau = Y alpha, [D] eqs. 11 to 13, shape (n, 2, 5)."""
    sine, cosine = np.sin(q[:, 0] - q[:, 1]), np.cos(q[:, 0] - q[:, 1])
    Y = np.zeros((q.shape[0], 2, 5))
    Y[:, 0, 0], Y[:, 1, 2] = a[:, 0], a[:, 1]
    Y[:, 0, 1] = 0.5 * (cosine * w[:, 1] ** 2 - sine * a[:, 1])
    Y[:, 1, 1] = -0.5 * (cosine * w[:, 0] ** 2 + sine * a[:, 0])
    Y[:, 0, 3], Y[:, 1, 4] = w[:, 0], w[:, 1]
    return Y


def _load_columns(acc: Array, d: Array) -> Array:
    """What m, kxx, ks, kyy and the equilibrium can do to the force along x and y, shape (2 n, 6)."""
    a, p = _low(acc), _low(d)
    zero, one = np.zeros(a.shape[0]), np.ones(a.shape[0])
    x = np.stack([a[:, 0], p[:, 0], p[:, 1], zero, one, zero], axis=1)
    y = np.stack([a[:, 1], zero, p[:, 0], p[:, 1], zero, one], axis=1)
    return np.concatenate([x, y])
