"""Studies whose truth is known, for bench/estimators.py: motion in closed form, or by an integration of its own.

Nothing of the estimators makes them. `axis`: one sliding axis under proportional and derivative control, robot
and load linear, so that the steady answer to a multisine reference is algebra; a force that nobody measures may
disturb the loop. `paper`: the two-joint robot of bench/coverage_study.py, in closed form too; the reference is
what a controller must have been told for that motion. `birdy`: a two-link arm in a vertical plane by Lagrange's
equations, integrated step by step under a controller that sees the noisy angles; noise as the benchmark BIRDy
has it (Leboutet et al., Applied Sciences 11, 4303, 2021: 1e-4, 1e-3 and 1e-2 deg, 0.05 N m).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import coverage_study
import numpy as np
from impid_host.impedance.loads import LoadModel, arm
from impid_host.robot.planar_2r_relative import Planar2RRelative
from impid_host.robot.slide_1d import Slide1D
from impid_host.robot.terms import RobotStructure, robot_structure
from impid_host.signals.align import AlignedTrial, align
from impid_host.signals.chain import DEFAULT, erode
from impid_host.study.model import RobotLog, RobotSetup, Setup, Trial

RATE, SECONDS = 100.0, 30.0
ORDINARY_M_S2 = 0.010  # rms per sample, as in bench/cutoff.py
KP, KD = 900.0, 60.0  # N/m, N s/m; of the paper's robot N m/rad, N m s/rad a tenth of that


@dataclass(frozen=True)
class Case:
    """Free and loaded trials and the truth: alpha (p,); load model and value (q,), or None."""

    free: Sequence[AlignedTrial]
    loaded: Sequence[AlignedTrial]
    structure: RobotStructure
    alpha: np.ndarray
    load: tuple[LoadModel, np.ndarray] | None


def axis(seed: int, factor: float, *, told: bool = False, disturbed: float = 0.0) -> Case:
    """A sliding axis of 1.5 kg, free and on an arm of 1.2 kg, 14 N s/m and 220 N/m.

    Args:
        factor: of the accelerometer's usual noise.
        told: the log holds what the controller was told.
        disturbed: rms of a force in the loop that nobody measures, N.
    """
    rng = np.random.default_rng([seed, round(10 * factor), told, round(10 * disturbed)])
    alpha, value, x0 = np.array([1.5, 6.0]), np.array([1.2, 14.0, 220.0]), 0.03
    load = arm(("x",)), np.append(value, value[2] * x0)
    free = [_on_axis(rng, k, alpha, np.zeros(3), 0.0, factor, told, disturbed) for k in range(2)]
    loaded = [_on_axis(rng, 2 + k, alpha, value, x0, factor, told, disturbed) for k in range(2)]
    return Case(free, loaded, RobotStructure(Slide1D()), alpha, load)


def _on_axis(
    rng: np.random.Generator,
    number: int,
    alpha: np.ndarray,
    load: np.ndarray,
    x0: float,
    factor: float,
    told: bool,
    disturbed: float,
) -> AlignedTrial:
    t = np.arange(int(RATE * SECONDS)) / RATE
    M, B, K = alpha[0] + load[0], alpha[1] + load[1], load[2]

    def answer(w: np.ndarray) -> np.ndarray:
        return np.asarray(1 / (-(w**2) * M + 1j * w * (B + KD) + K + KP))

    w = 2 * np.pi * rng.uniform(0.1, 3.0, 20)
    R = 0.012 * np.sqrt(2 / 20) * np.exp(2j * np.pi * rng.uniform(size=20))
    wd = 2 * np.pi * rng.uniform(0.1, 4.0, 60)
    D = disturbed * np.sqrt(2 / 60) * np.exp(2j * np.pi * rng.uniform(size=60))
    X = np.concatenate([(KP + 1j * w * KD) * answer(w) * R, answer(wd) * D])
    every = np.concatenate([w, wd])
    turn = np.exp(1j * t[:, None] * every)
    centre = 0.05
    resting = (KP * centre + K * x0) / (KP + K)
    x, v, a = (np.real(turn @ ((1j * every) ** k * X)) for k in range(3))
    r = centre + np.real(turn[:, :20] @ R)
    r_dot = np.real(turn[:, :20] @ (1j * w * R))
    x = x + resting
    tau = KP * (r - x) + KD * (r_dot - v) + rng.normal(0, 0.10, len(t))
    measured = a + rng.normal(0, ORDINARY_M_S2 * factor, len(t))
    x, v, measured, tau, r = (values[:, None] for values in (x, v, measured, tau, r))
    return AlignedTrial(
        name=f"trial_{number:02d}", kind="free" if number < 2 else "arm", load="free" if number < 2 else "load",
        t=t, rate_hz=RATE, theta=x, omega=v, theta_dd=measured, tau=tau, force=None, perturbation=None,
        x=x, v=v, a=measured, valid=erode(np.ones(len(t), dtype=bool), int(DEFAULT.edge_s * RATE)),
        source="accelerometer", clock=None, reference=r if told else None,
    )  # fmt: skip


def paper(seed: int, factor: float, kind: str, *, told: bool = False) -> Case:
    """The two-joint robot of bench/coverage_study.py, white noise, free and loaded."""
    coverage_study.ACCELERATION_M_S2 = ORDINARY_M_S2 * factor
    rng = np.random.default_rng([seed, 3])
    load = coverage_study.truth(kind)
    free = [_told(*coverage_study.trial(rng, k, None, None), told) for k in range(2)]
    loaded = [_told(*coverage_study.trial(rng, 2 + k, load, None), told) for k in range(2)]
    return Case(free, loaded, coverage_study.STRUCTURE, coverage_study.ALPHA, load)


def _told(noisy: AlignedTrial, clean: AlignedTrial, told: bool) -> AlignedTrial:
    """tau = kp (r - theta) - kd omega gives the reference of an exact motion."""
    reference = clean.theta + (clean.tau + 0.1 * KD * clean.omega) / (0.1 * KP)
    return replace(noisy, reference=reference) if told else noisy


# Two links in a vertical plane: masses, centres, inertias about the centres, viscous and dry friction.
M1, M2, L1, L2, C1, C2, J1, J2 = 8.0, 5.0, 0.45, 0.40, 0.21, 0.17, 0.15, 0.08
VISCOUS, DRY = np.array([4.0, 2.0]), np.array([3.0, 1.5])
GRAVITY = 9.81
STIFF, DAMPED = np.array([2500.0, 900.0]), np.array([160.0, 50.0])
BIRDY_TORQUE_NM, BIRDY_HZ, BIRDY_SECONDS = 0.05, 1000.0, 20.0


def birdy_truth() -> np.ndarray:
    """Of the base parameters and dry friction, by their definitions."""
    zz1 = J1 + M1 * C1**2 + M2 * L1**2
    return np.array([zz1, J2 + M2 * C2**2, M2 * C2, 0.0, M1 * C1 + M2 * L1, 0.0, *VISCOUS, *DRY])


def birdy(seeds: Sequence[int], noise_deg: float) -> list[Case]:
    """One study of two free trials for each seed, all integrated side by side."""
    structure = robot_structure(Planar2RRelative(L1, L2, (0.0, -GRAVITY)), ("friction.coulomb",))
    setup = Setup(RobotSetup("planar-2r-relative", (L1, L2), (0.0, -GRAVITY)))
    logs = _birdy_logs([(seed, k) for seed in seeds for k in range(2)], np.deg2rad(noise_deg))
    trials = [
        align(Trial(f"free_{k % 2 + 1:02d}", "free", "free", log), setup, structure.model, DEFAULT)
        for k, log in enumerate(logs)
    ]
    return [Case(trials[k : k + 2], (), structure, birdy_truth(), None) for k in range(0, len(trials), 2)]


def _birdy_logs(numbers: Sequence[tuple[int, int]], noise_rad: float) -> list[RobotLog]:
    """Five harmonics of 0.1 Hz per joint and a controller at every millisecond that sees the noise."""
    rngs = [np.random.default_rng([*number, round(1e9 * noise_rad)]) for number in numbers]
    t = np.arange(int(BIRDY_HZ * BIRDY_SECONDS)) / BIRDY_HZ
    w = 2 * np.pi * 0.1 * np.arange(1, 6)
    size = np.stack([rng.normal(size=(5, 2)) / np.arange(1, 6)[:, None] for rng in rngs])
    phase = np.stack([rng.uniform(0, 2 * np.pi, (5, 2)) for rng in rngs])
    angle = t[:, None, None, None] * w[:, None] + phase  # (T, B, 5, 2)
    r = 0.8 * np.einsum("bhj,tbhj->tbj", size, np.sin(angle)) + np.array([-np.pi / 4, np.pi / 3])
    r_dot = 0.8 * np.einsum("bhj,tbhj->tbj", size * w[:, None], np.cos(angle))
    seen = np.stack([rng.normal(0, noise_rad, (len(t), 2)) for rng in rngs], axis=1)
    felt = np.stack([rng.normal(0, BIRDY_TORQUE_NM, (len(t), 2)) for rng in rngs], axis=1)
    q, s = r[0].copy(), r_dot[0].copy()
    before = q + seen[0]
    angles, torques = np.empty_like(r), np.empty_like(r)
    dt = 1 / BIRDY_HZ
    for k in range(len(t)):
        measured = q + seen[k]
        tau = STIFF * (r[k] - measured) + DAMPED * (r_dot[k] - (measured - before) / dt)
        angles[k], torques[k], before = measured, tau, measured
        a1 = _two_links(q, s, tau)
        a2 = _two_links(q + dt / 2 * s, s + dt / 2 * a1, tau)
        a3 = _two_links(q + dt / 2 * s + dt**2 / 4 * a1, s + dt / 2 * a2, tau)
        a4 = _two_links(q + dt * s + dt**2 / 2 * a2, s + dt * a3, tau)
        q, s = q + dt * s + dt**2 / 6 * (a1 + a2 + a3), s + dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    # The command of an instant is held until the next: its mean lies half a period later.
    logged = 0.5 * (torques + np.concatenate([torques[:1], torques[:-1]])) + felt
    return [
        RobotLog(t, angles[:, b], logged[:, b], reference=np.ascontiguousarray(r[:, b]))
        for b in range(len(numbers))
    ]


def _two_links(q: np.ndarray, s: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Lagrange's equations, (B, 2) each."""
    c2, s2 = np.cos(q[:, 1]), np.sin(q[:, 1])
    a = J1 + J2 + M1 * C1**2 + M2 * (L1**2 + C2**2)
    b, d = M2 * L1 * C2, J2 + M2 * C2**2
    m11, m12 = a + 2 * b * c2, d + b * c2
    whole = q[:, 0] + q[:, 1]
    weight2 = M2 * C2 * GRAVITY * np.cos(whole)
    weight1 = (M1 * C1 + M2 * L1) * GRAVITY * np.cos(q[:, 0]) + weight2
    friction = VISCOUS * s + DRY * np.sign(s)
    f1 = tau[:, 0] - friction[:, 0] - weight1 + b * s2 * (2 * s[:, 0] * s[:, 1] + s[:, 1] ** 2)
    f2 = tau[:, 1] - friction[:, 1] - weight2 - b * s2 * s[:, 0] ** 2
    det = m11 * d - m12**2
    return np.stack([(d * f1 - m12 * f2) / det, (m11 * f2 - m12 * f1) / det], axis=1)
