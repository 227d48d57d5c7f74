"""How often the time domain's 95 % intervals hold the truth, and its squared error over the Cramer-Rao bound.

    python bench/coverage.py [STUDIES] [--markdown FILE]

Each study is two free and two loaded trials of 30 s in closed form at 250 Hz, with the accelerometer's noise
on x'' and noise on torque and force sensor that is white or has a pole at 1.5 or 0.3 Hz, and goes through
`identify_robot` and `identify_load` as in `fit`. The bound is that of all parameters of the study together,
robot and load, from the samples that were fitted, with the noise's spectrum known.
"""

import sys
from collections import defaultdict
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
from impid_host.errors import UndeterminedError
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
RATE, DURATION = 250.0, 30.0
POLES_HZ = {"white": None, "pole at 1.5 Hz": 1.5, "pole at 0.3 Hz": 0.3}
# rms over all frequencies up to 125 Hz, of which 4.5 Hz are looked at.
TORQUE_NM, FORCE_N, ACCELERATION_M_S2 = 0.02, 0.2, 0.015
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
    return np.concatenate([values[:1] * 0, values[1:] - p * values[:-1]]) / (rms * np.sqrt(1 - p**2))


def trial(
    rng: np.random.Generator, number: int, load: tuple[LoadModel, np.ndarray] | None, pole_hz: float | None
) -> tuple[AlignedTrial, AlignedTrial]:
    """Ten sinusoids per joint in 0 to 2 Hz, 40 deg free, 10 deg loaded: measured, and without noise."""
    t = np.arange(int(RATE * DURATION)) / RATE
    w = 2 * np.pi * rng.uniform(0.05, 2.0, (2, 10))
    p = rng.uniform(0, 2 * np.pi, (2, 10))
    angle = t[:, None, None] * w + p
    gain = np.deg2rad(40.0 if load is None else 10.0) / np.ptp(np.sin(angle).sum(axis=2), axis=0)
    theta = np.pi / 4 + gain * np.sin(angle).sum(axis=2)
    omega = gain * (w * np.cos(angle)).sum(axis=2)
    theta_dd = -gain * (w**2 * np.sin(angle)).sum(axis=2)
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


def one_study(seed: int, kind: str, pole_hz: float | None, chain: Chain = DEFAULT) -> Values:
    """Every parameter by every method: value, truth, interval, bound on its variance."""
    rng = np.random.default_rng([seed, 7])
    load = truth(kind)
    free, clean_free = zip(*(trial(rng, k, None, pole_hz) for k in range(2)), strict=True)
    loaded, clean_loaded = zip(*(trial(rng, 2 + k, load, pole_hz) for k in range(2)), strict=True)
    split = Split()
    robot = identify_robot(free, STRUCTURE, chain, split)
    bounds = study_bounds(clean_free, clean_loaded, load[0], chain, split, pole_hz)
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
    model: LoadModel,
    chain: Chain,
    split: Split,
    pole_hz: float | None,
) -> dict[str, np.ndarray]:
    """Cramer-Rao: robot and load jointly from the torques (method 1), load from the force (method 2)."""
    p, q = len(ALPHA), len(model.columns)
    alone, joint, direct = np.zeros((p, p)), np.zeros((p + q, p + q)), np.zeros((q, q))
    for part in free:
        rows = split.masks(part, chain)[0]
        Y = whitened(ROBOT.regressor(part.theta, part.omega, part.theta_dd), TORQUE_NM, pole_hz)[rows]
        alone += np.einsum("ncp,ncq->pq", Y, Y)
    joint[:p, :p] = alone
    for part in loaded:
        rows = split.masks(part, chain)[0]
        A = model.regressor(part.x, part.v, part.a)
        Y = ROBOT.regressor(part.theta, part.omega, part.theta_dd)
        J_T = np.swapaxes(ROBOT.jacobian(part.theta), 1, 2)
        both = whitened(np.concatenate([Y, J_T @ A], axis=2), TORQUE_NM, pole_hz)[rows]
        joint += np.einsum("ncp,ncq->pq", both, both)
        A = whitened(A, FORCE_N, pole_hz)[rows]
        direct += np.einsum("ncp,ncq->pq", A, A)
    return {
        "robot": np.linalg.inv(alone),
        "method 1": np.linalg.inv(joint)[p:, p:],
        "method 2": np.linalg.inv(direct),
    }


def campaign(kind: str, colour: str, studies: int) -> dict[str, dict[str, float]]:
    """Coverage (%) and mean squared error over the bound, per parameter."""
    every: Values = defaultdict(list)
    with ProcessPoolExecutor(2) as pool:
        jobs = [pool.submit(one_study, seed, kind, POLES_HZ[colour]) for seed in range(studies)]
        for job in jobs:
            try:
                for name, rows in job.result().items():
                    every[name] += rows
            except UndeterminedError as error:
                print(f"refused: {error}", file=sys.stderr)
    out = {}
    for name, rows in every.items():
        value, true, low, high, bound = np.array(rows).T
        out[name] = {
            "coverage_percent": float(100 * np.mean((low <= true) & (true <= high))),
            "mse_over_crb": float(np.mean((value - true) ** 2) / np.mean(bound)),
            "bias_over_sd": float(np.mean(value - true) / np.std(value)),
        }
    return out


def main() -> None:
    words = sys.argv[1:]
    to = Path(words.pop(words.index("--markdown") + 1)) if "--markdown" in words else None
    words = [word for word in words if word != "--markdown"]
    studies = int(words[0]) if words else 500
    lines = [
        "# Intervals and efficiency in the time domain",
        "",
        f"`python bench/coverage.py {studies}`: {studies} simulated studies per row; a true 95 % counted in so many has a "
        f"standard error of {100 * np.sqrt(0.95 * 0.05 / studies):.1f} % per parameter. Lowest and highest are over the "
        "parameters. The bound for Method 1 is that of robot and load fitted jointly; ours takes the robot from the "
        "free trials alone, as the paper does.",
        "",
        "| load, noise | part | coverage: mean (lowest, highest) % | MSE / bound: mean (highest) |",
        "| --- | --- | --- | --- |",
    ]
    for kind in LOADS:
        for colour in POLES_HZ:
            result = campaign(kind, colour, studies)
            for part in ("robot", "method 1", "method 2"):
                own = {name: entry for name, entry in result.items() if name.startswith(part)}
                cover = np.array([entry["coverage_percent"] for entry in own.values()])
                ratio = {name: entry["mse_over_crb"] for name, entry in own.items()}
                worst = max(ratio, key=ratio.__getitem__)
                cells = f"{cover.mean():.1f} ({cover.min():.1f}, {cover.max():.1f})"
                mean = np.mean(list(ratio.values()))
                name = worst.removeprefix(part).strip()
                lines.append(
                    f"| {kind}, {colour} | {part} | {cells} | {mean:.2f} ({ratio[worst]:.2f}, {name}) |"
                )
                print(lines[-1], flush=True)
            if to is not None:
                to.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
