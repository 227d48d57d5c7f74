"""Everything that a seed decides before anything moves: the robot, its loads, its instruments, the trials."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from .mechanics import Array, Load, Robot
from .noise import UNUSUAL, USUAL

SENSOR, ARM, SPRING, WEIGHED = "force_sensor", "arm", "mass-spring", "weighed"


@dataclass(frozen=True)
class Noise:
    """A channel's noise; ``level`` is its root mean square below 10 Hz in the channel's own unit."""

    kind: str
    level: float
    walk: float = 0.0  # a random walk beside it, as a share of the level


@dataclass(frozen=True)
class Instruments:
    """What the records are made with. Rates in Hz, angles in rad, times in s, clocks in ppm."""

    counts: tuple[int, ...]
    zero: tuple[float, float]
    direction: tuple[int, ...]
    full_scale_code: int
    vref: float
    zero_g: tuple[float, float]
    sensitivity: tuple[float, float]
    mount: str
    mount_angle: float
    ready_made: bool  # the module gives m/s² and rad, not codes and counts
    module_rate: float
    module_ppm: float
    robot_rate: float
    robot_ppm: float
    robot_restarts: bool
    sync: bool
    force: bool
    force_timing: str
    force_frame: str
    force_angle: float
    torque_step: float  # share of the noise level that one step of the log is worth; 0 for none
    force_step: float
    jitter: float  # of the robot's rows, about where the log says; share of a period
    jitter_tails: bool
    module_losses: float  # share of rows
    robot_losses: float
    periodic_losses: int  # every so many rows one is missing; 0 for never
    torque: Noise
    accel: Noise
    sensor: Noise


@dataclass(frozen=True)
class Plan:
    """One trial before it is run; ``reach`` is half the joints' range in rad."""

    folder: str
    kind: str
    load: Load | None
    duration: float
    style: str
    reach: float
    lead: float  # pause before it, s


@dataclass(frozen=True)
class Laboratory:
    seed: int
    robot: Robot
    centre: tuple[float, float]
    stiffness: float  # rad/s, the controller's bandwidth
    damping: float
    instruments: Instruments
    plans: tuple[Plan, ...]
    declared: dict[str, bool]

    @property
    def home(self) -> Array:
        return np.asarray(self.robot.tip(np.array([self.centre]))[0])


def _log_uniform(rng: Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _robot(rng: Generator) -> Robot:
    l1, l2 = rng.uniform(0.22, 0.40), rng.uniform(0.22, 0.40)
    m1, m2 = rng.uniform(0.2, 0.8), rng.uniform(0.2, 0.7)
    r1, r2 = rng.uniform(0.3, 0.55) * l1, rng.uniform(0.35, 0.6) * l2
    rotors = rng.uniform(0.01, 0.06, 2)
    alpha = (
        m1 * (l1**2 / 12 + r1**2) + m2 * l1**2 + rotors[0],
        2 * m2 * l1 * r2,
        m2 * (l2**2 / 12 + r2**2) + rotors[1],
        _log_uniform(rng, 0.02, 0.2),
        _log_uniform(rng, 0.02, 0.2),
    )
    return Robot((float(l1), float(l2)), tuple(float(a) for a in alpha), (m1 * r1 + m2 * l1, m2 * r2))


def _turn(angle: float) -> Array:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def _spring(rng: Generator, home: Array, name: str, weighed: bool) -> Load:
    turn = _turn(rng.uniform(0, np.pi))
    K = turn @ np.diag([_log_uniform(rng, 150, 600), _log_uniform(rng, 150, 600)]) @ turn.T
    m = rng.uniform(0.4, 1.6)
    scale_error = rng.normal(0, 0.002)
    return Load(
        name,
        SPRING,
        m * np.eye(2),
        np.zeros((2, 2)),
        K,
        home + rng.normal(0, 0.01, 2),
        payload=round(m + scale_error, 4) if weighed else None,
    )


def _arm(rng: Generator, home: Array, name: str, handle: float) -> Load:
    """A shoulder and an elbow with joint stiffness (two-joint muscles among it), seen at the hand."""
    upper, lower = rng.uniform(0.26, 0.34), rng.uniform(0.28, 0.36)
    shoulder, elbow = np.radians(rng.uniform(25, 75)), np.radians(rng.uniform(60, 110))
    s, c, s12, c12 = np.sin(shoulder), np.cos(shoulder), np.sin(shoulder + elbow), np.cos(shoulder + elbow)
    J = np.array([[-upper * s - lower * s12, -lower * s12], [upper * c + lower * c12, lower * c12]])
    m1, m2 = rng.uniform(1.4, 2.4), rng.uniform(0.9, 1.6)
    i2 = m2 * lower**2 * (1 / 12 + 0.43**2)
    couple = m2 * upper * 0.43 * lower * np.cos(elbow)
    i1 = m1 * upper**2 * (1 / 12 + 0.44**2) + m2 * upper**2 + i2 + 2 * couple
    two_joint = rng.uniform(1, 5)
    k = np.array([[rng.uniform(6, 24) + two_joint, two_joint], [two_joint, rng.uniform(5, 18) + two_joint]])
    k = k + rng.uniform(-1.5, 1.5) * np.array([[0, 1], [-1, 0]])  # reflexes need not be symmetric
    b = k.T.copy() * rng.uniform(0.04, 0.12)
    to_hand = np.linalg.inv(J)
    return Load(
        name,
        ARM,
        to_hand.T @ np.array([[i1, i2 + couple], [i2 + couple, i2]]) @ to_hand,
        to_hand.T @ (0.5 * (b + b.T)) @ to_hand,
        to_hand.T @ k @ to_hand,
        home + rng.normal(0, 0.015, 2),
        handle,
    )


def _loads(rng: Generator, home: Array, needs: frozenset[str], sort: str, handle: float) -> list[Load]:
    kinds = ([ARM] if ARM in needs else []) + ([SPRING] if needs & {SPRING, WEIGHED} else [])
    while len(kinds) < {"short": 2, "usual": int(rng.integers(2, 5)), "long": int(rng.integers(3, 7))}[sort]:
        kinds.append(str(rng.choice([ARM, SPRING], p=[0.4, 0.6])))
    weighed = WEIGHED in needs or rng.random() < 0.5
    loads, made = [], {ARM: 0, SPRING: 0}
    for kind in kinds:
        made[kind] += 1
        label = chr(ord("A") + made[kind] - 1)
        loads.append(
            _arm(rng, home, f"arm_{label}", handle)
            if kind == ARM
            else _spring(rng, home, f"springs_{label}", weighed)
        )
    return loads


def _plans(rng: Generator, loads: list[Load], sort: str) -> tuple[Plan, ...]:
    free = {"short": 1, "usual": 2, "long": int(rng.integers(2, 5))}[sort]
    duration = {"short": 15.0, "usual": float(rng.integers(20, 41)), "long": float(rng.integers(35, 51))}[
        sort
    ]
    repeats = {"short": 1, "usual": 1 if len(loads) > 3 else 2, "long": 2 if len(loads) < 5 else 1}[sort]
    free_reach, load_reach = np.radians(rng.uniform(9, 20)), np.radians(rng.uniform(3, 7))
    ways = ["multisine", "multisine", "moves", "chirp", "mixed"]
    free_style, load_style = str(rng.choice(ways)), str(rng.choice(ways))
    wanted: list[tuple[str, str, Load | None, str, float]] = [
        (f"free_{i + 1:02d}", "free", None, free_style, free_reach) for i in range(free)
    ]
    wanted += [
        (f"{load.name}_{i + 1:02d}", load.kind, load, load_style, load_reach)
        for load in loads
        for i in range(repeats)
    ]
    return tuple(
        Plan(
            folder, kind, load, duration + float(rng.uniform(-1, 1)), style, reach, float(rng.uniform(4, 40))
        )
        for folder, kind, load, style, reach in wanted
    )


def _noise(rng: Generator, level: float, unusual: bool) -> Noise:
    kinds = sorted(UNUSUAL) if unusual else sorted(USUAL)
    odds = None if unusual else [0.2, 0.2, 0.6]
    walk = float(rng.uniform(0.03, 0.12)) if unusual and rng.random() < 0.3 else 0.0
    return Noise(str(rng.choice(kinds, p=odds)), level, walk)


def _instruments(rng: Generator, needs: frozenset[str], unusual: bool) -> Instruments:
    def sometimes(share: float) -> bool:
        return bool(rng.random() < (max(share, 0.35) if unusual else share))

    sensitivity = rng.uniform(0.55, 0.7)
    losses = float(_log_uniform(rng, 1e-4, 1e-2)) if sometimes(0.3) else 0.0
    return Instruments(
        counts=tuple(int(c) for c in rng.choice([80000, 131072, 262144, 400000, 1048576], 2)),
        zero=tuple(np.round(rng.uniform(-0.6, 0.6, 2), 4)) if rng.random() < 0.5 else (0.0, 0.0),
        direction=tuple(int(s) for s in rng.choice([-1, 1], 2)),
        full_scale_code=int(rng.choice([4096, 16384, 65536], p=[0.15, 0.15, 0.7])),
        vref=3.3,
        zero_g=tuple(np.round(rng.uniform(1.6, 1.7, 2), 4)),
        sensitivity=tuple(np.round(sensitivity * rng.uniform(0.98, 1.02, 2), 4)),
        mount="link2" if rng.random() < 0.85 else "fixed",
        mount_angle=float(np.round(rng.uniform(-np.pi, np.pi), 4)) if rng.random() < 0.5 else 0.0,
        ready_made=bool(rng.random() < 0.1),
        module_rate=float(rng.choice([500.0, 800.0, 1000.0])),
        module_ppm=float(rng.normal(0, 25)),
        robot_rate=float(rng.choice([100, 200, 250, 500, 1000, 2000], p=[0.1, 0.15, 0.2, 0.25, 0.2, 0.1])),
        robot_ppm=float(rng.uniform(-120, 120)),
        robot_restarts=bool(rng.random() < 0.5),
        sync=bool(rng.random() < 0.15),
        force=SENSOR in needs or bool(rng.random() < 0.55),
        force_timing="mean" if rng.random() < 0.6 else "instant",
        force_frame="base" if rng.random() < 0.7 else "link2",
        force_angle=float(np.round(rng.uniform(-np.pi, np.pi), 3)) if rng.random() < 0.3 else 0.0,
        torque_step=float(rng.uniform(1.5, 6)) if sometimes(0.1) else 0.0,
        force_step=float(rng.uniform(1.5, 6)) if sometimes(0.1) else 0.0,
        jitter=float(rng.uniform(0.02, 0.15)) if sometimes(0.3) else 0.0,
        jitter_tails=sometimes(0.1),
        module_losses=losses,
        robot_losses=losses * float(rng.uniform(0, 1)),
        periodic_losses=int(rng.integers(40, 400)) if unusual and rng.random() < 0.3 else 0,
        torque=_noise(rng, _log_uniform(rng, 0.003, 0.03), unusual),  # of the torque's own size, scaled later
        accel=_noise(rng, _log_uniform(rng, 0.002, 0.01), unusual),
        sensor=_noise(rng, _log_uniform(rng, 0.01, 0.06), unusual),
    )


def draw(seed: int, needs: frozenset[str] = frozenset(), unusual: bool = False) -> Laboratory:
    """The laboratory of a seed; ``needs`` are what an effect cannot do without (a force sensor, an arm...)."""
    rng = np.random.default_rng([seed, 1])
    robot = _robot(rng)
    middle = np.radians(rng.uniform(30, 65))
    centre = (float(middle), float(middle + np.radians(rng.uniform(-20, 20))))
    home = robot.tip(np.array([centre]))[0]
    sort = str(rng.choice(["short", "usual", "long"], p=[0.15, 0.65, 0.2]))
    handle = float(np.round(rng.uniform(0.05, 0.3), 3)) if rng.random() < 0.8 else 0.0
    loads = _loads(rng, home, needs, sort, handle)
    return Laboratory(
        seed,
        robot,
        centre,
        stiffness=2 * np.pi * float(rng.uniform(5, 9)),
        damping=float(rng.uniform(0.5, 0.9)),
        instruments=_instruments(np.random.default_rng([seed, 2]), needs, unusual),
        plans=_plans(rng, loads, sort),
        declared={"prior": bool(rng.random() < 0.15), "tolerance": bool(rng.random() < 0.3)},
    )
