"""One simulated study in closed form: every parameter with its interval, and the bound on its variance.

Two free and two loaded trials of 30 s at 100 Hz, with the accelerometer's noise on x'' and noise on torque and
force sensor that is white or has a pole at 1.5 or 0.3 Hz, through `identify_robot` and `identify_load` as in
`fit`. The bound is that of all parameters of the study together, robot and load, from the samples that were
fitted, with the spectra of all noise known, the accelerometer's too.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from impid_host.impedance.identify import LoadFit, RobotFit, identify_load, identify_robot
from impid_host.impedance.loads import LoadModel, arm, mass_spring
from impid_host.impedance.rows import Split
from impid_host.robot.planar_2r_absolute import Planar2RAbsolute
from impid_host.robot.terms import RobotStructure
from impid_host.signals.align import AlignedTrial, joint_acceleration
from impid_host.signals.chain import DEFAULT, Chain, erode
from scipy import signal

ROBOT = Planar2RAbsolute(0.254, 0.2667)
STRUCTURE = RobotStructure(ROBOT)
ALPHA = np.array([0.06929, 0.04217, 0.04416, 0.06510, 0.07389])
RATE, DURATION = 100.0, 30.0
POLES_HZ = {"white": None, "pole at 1.5 Hz": 1.5, "pole at 0.3 Hz": 0.3}
# rms over all frequencies up to 50 Hz, of which 4.5 Hz are looked at.
TORQUE_NM, FORCE_N, ACCELERATION_M_S2 = 0.013, 0.13, 0.010
X0 = np.array([0.364, -0.009])
LOADS: dict[str, tuple[LoadModel, np.ndarray]] = {
    "mass-spring": (mass_spring(), np.array([0.786, 421.57, 213.35, -18.87, 0.0, 0.0])),
    "arm": (
        arm(),
        np.array([1.42, 0.68, 0.69, 0.99, 14.26, 1.62, 1.08, 6.82, 90.97, 17.05, 25.92, 27.22, 0.0, 0.0]),
    ),
}
Values = dict[str, list[tuple[float, float, float, float, float]]]  # value, truth, low, high, bound


def truth(name: str) -> tuple[LoadModel, np.ndarray]:
    """The load's parameters with K x0 filled in."""
    model, value = LOADS[name]
    value = value.copy()
    value[model.place] = (model.matrix_map("x") @ value).reshape(2, 2) @ X0
    return model, value


def noise(rng: np.random.Generator, rms: float, pole_hz: float | None) -> np.ndarray:
    """(N, 2) of the given rms, white or first-order coloured."""
    count = int(RATE * DURATION)
    white = rng.normal(size=(count + 2000, 2))
    p = 0.0 if pole_hz is None else np.exp(-2 * np.pi * pole_hz / RATE)
    coloured: np.ndarray = signal.lfilter([np.sqrt(1 - p**2)], [1.0, -p], white, axis=0)
    return rms * coloured[2000:]


def whitened(values: np.ndarray, rms: float, pole_hz: float | None) -> np.ndarray:
    """`values` (N, ...) through the filter that makes the noise white with unit variance."""
    p = 0.0 if pole_hz is None else np.exp(-2 * np.pi * pole_hz / RATE)
    left = np.concatenate([values[:1] * 0, values[1:] - p * values[:-1]])
    return np.asarray(left / (rms * np.sqrt(1 - p**2)))


def trial(
    rng: np.random.Generator, number: int, load: tuple[LoadModel, np.ndarray] | None, pole_hz: float | None
) -> tuple[AlignedTrial, AlignedTrial]:
    """Ten sinusoids per joint in 0 to 2 Hz, 40 deg free, 10 deg loaded: measured, and without noise."""
    t = np.arange(int(RATE * DURATION)) / RATE
    w = 2 * np.pi * rng.uniform(0.05, 2.0, (2, 10))
    p = rng.uniform(0, 2 * np.pi, (2, 10))
    angle = t[:, None, None] * w + p
    sine = np.sin(angle)
    gain = np.deg2rad(40.0 if load is None else 10.0) / np.ptp(sine.sum(axis=2), axis=0)
    theta = np.pi / 4 + gain * sine.sum(axis=2)
    omega = gain * (w * np.cos(angle)).sum(axis=2)
    theta_dd = -gain * (w**2 * sine).sum(axis=2)
    J, J_rate = ROBOT.jacobian(theta), ROBOT.jacobian_rate(theta, omega)
    x, v = ROBOT.position(theta), np.einsum("nij,nj->ni", J, omega)
    a = np.einsum("nij,nj->ni", J, theta_dd) + np.einsum("nij,nj->ni", J_rate, omega)
    tau = ROBOT.regressor(theta, omega, theta_dd) @ ALPHA
    force = None
    if load is not None:
        model, value = load
        F = -model.regressor(x, v, a) @ value
        tau = tau - np.einsum("nji,nj->ni", J, F)
        force = F + noise(rng, FORCE_N, pole_hz)
    measured = a + rng.normal(0, ACCELERATION_M_S2, a.shape)
    clean = AlignedTrial(
        name=f"trial_{number:02d}",
        kind="free" if load is None else "arm",
        load="free" if load is None else "load",
        t=t,
        rate_hz=RATE,
        theta=theta,
        omega=omega,
        theta_dd=theta_dd,
        tau=tau,
        force=force,
        perturbation=None,
        x=x,
        v=v,
        a=a,
        valid=erode(np.ones(len(t), dtype=bool), int(DEFAULT.edge_s * RATE)),
        source="accelerometer",
        clock=None,
    )
    noisy = replace(
        clean,
        theta_dd=joint_acceleration(measured, J, J_rate, omega),
        a=measured,
        tau=tau + noise(rng, TORQUE_NM, pole_hz),
    )
    return noisy, clean


def one_study(seed: int, kind: str, colour: str, chain: Chain = DEFAULT) -> Values:
    """Every parameter by every method: value, truth, interval, bound on its variance."""
    pole_hz = POLES_HZ[colour]
    rng = np.random.default_rng([seed, list(LOADS).index(kind), list(POLES_HZ).index(colour)])
    load = truth(kind)
    free, clean_free = zip(*(trial(rng, k, None, pole_hz) for k in range(2)), strict=True)
    loaded, clean_loaded = zip(*(trial(rng, 2 + k, load, pole_hz) for k in range(2)), strict=True)
    split = Split()
    robot = identify_robot(free, STRUCTURE, chain, split)
    bounds = study_bounds(clean_free, clean_loaded, load, chain, split, pole_hz)
    out: Values = defaultdict(list)
    _record_robot(out, robot, bounds["robot"])
    for method, known in (("method 1", robot.parameters), ("method 2", None)):
        fit = identify_load(loaded, load[0], chain, split, robot=known, handle_mass_kg=0.0)
        _record_load(out, method, fit, load[1], bounds[method])
    return dict(out)


def _record_robot(out: Values, fit: RobotFit, bound: np.ndarray) -> None:
    for k, name in enumerate(fit.estimate.names):
        low, high = fit.estimate.ci95[k]
        out[f"robot {name}"].append((fit.estimate.value[k], ALPHA[k], low, high, bound[k, k]))


def _record_load(out: Values, method: str, fit: LoadFit, value: np.ndarray, bound: np.ndarray) -> None:
    names = fit.estimate.names
    for k, name in enumerate(names):
        if k not in fit.model.place:
            low, high = fit.estimate.ci95[k]
            out[f"{method} {name}"].append((fit.estimate.value[k], value[k], low, high, bound[k, k]))
    S = fit.model.matrix_map("x")
    slope = np.zeros((2, len(names)))
    slope[:, fit.model.place] = np.eye(2)
    slope -= np.einsum("ijq,j->iq", S.reshape(2, 2, -1), X0)
    slope = np.linalg.solve((S @ value).reshape(2, 2), slope)
    best = np.diag(slope @ bound @ slope.T)
    for k, name in enumerate(("x0", "y0")):
        low, high = fit.x0.ci95[k]
        out[f"{method} {name}"].append((fit.x0.value[k], X0[k], low, high, best[k]))


def study_bounds(
    free: Sequence[AlignedTrial],
    loaded: Sequence[AlignedTrial],
    load: tuple[LoadModel, np.ndarray],
    chain: Chain,
    split: Split,
    pole_hz: float | None,
) -> dict[str, np.ndarray]:
    """Cramer-Rao: robot and load jointly from the torques (method 1), load from the force (method 2)."""
    model, value = load
    mass = (model.matrix_map("a") @ value).reshape(2, 2)
    p, q = len(ALPHA), len(model.columns)
    alone, joint, direct = np.zeros((p, p)), np.zeros((p + q, p + q)), np.zeros((q, q))
    for part in free:
        rows = split.masks(part, chain)[0]
        Y = ROBOT.regressor(part.theta, part.omega, part.theta_dd)
        alone += information(Y, robot_mass(part), rows, TORQUE_NM, pole_hz)
    joint[:p, :p] = alone
    for part in loaded:
        rows = split.masks(part, chain)[0]
        A = model.regressor(part.x, part.v, part.a)
        Y = ROBOT.regressor(part.theta, part.omega, part.theta_dd)
        J_T = np.swapaxes(ROBOT.jacobian(part.theta), 1, 2)
        both = np.concatenate([Y, J_T @ A], axis=2)
        joint += information(both, robot_mass(part) + J_T @ mass, rows, TORQUE_NM, pole_hz)
        direct += information(A, np.broadcast_to(mass, (len(A), 2, 2)), rows, FORCE_N, pole_hz)
    return {
        "robot": np.linalg.inv(alone),
        "method 1": np.linalg.inv(joint)[p:, p:],
        "method 2": np.linalg.inv(direct),
    }


def robot_mass(part: AlignedTrial) -> np.ndarray:
    """How an acceleration of the end-effector enters the torques, I J^-1, (N, 2, 2)."""
    still = np.zeros_like(part.theta)
    unit = [np.broadcast_to(axis, still.shape) for axis in np.eye(2)]
    inertia = np.stack([ROBOT.regressor(part.theta, still, axis) @ ALPHA for axis in unit], axis=2)
    result: np.ndarray = inertia @ np.linalg.inv(ROBOT.jacobian(part.theta))
    return result


def information(
    design: np.ndarray, gain: np.ndarray, rows: np.ndarray, rms: float, pole_hz: float | None
) -> np.ndarray:
    """Fisher's, of parameters behind `design` (N, 2, q), accelerations known as the accelerometer knows them.

    Its noise enters through `gain` (N, 2, 2), whose square is taken as constant over the trial, and adds to the
    spectrum that the torque's or the force's noise has.
    """
    white = whitened(design, rms, pole_hz)[rows]
    p = 0.0 if pole_hz is None else np.exp(-2 * np.pi * pole_hz / RATE)
    R = np.fft.fft(white, axis=0, norm="ortho")
    turn = np.exp(-2j * np.pi * np.fft.fftfreq(len(R)))
    added = np.mean(gain @ np.swapaxes(gain, 1, 2), axis=0) * ACCELERATION_M_S2**2 / (rms**2 * (1 - p**2))
    S = np.eye(2) + (np.abs(1 - p * turn) ** 2)[:, None, None] * added
    result: np.ndarray = np.einsum("fcp,fcq->pq", R.conj(), np.linalg.solve(S, R), optimize=True).real
    return result
