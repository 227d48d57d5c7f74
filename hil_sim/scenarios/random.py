"""Random studies for validation campaigns: another robot, loads, clocks and chance for each seed."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hil_sim.effects import catalogue
from hil_sim.effects.entry import Entry
from hil_sim.effects.strength import Clean, scaled_to
from hil_sim.effects.strength import strength as measured
from hil_sim.errors import SimError
from hil_sim.plant.kinematics import joint_angles
from hil_sim.scenarios.random_effects import drawn
from hil_sim.scenarios.schema import Scenario, Trial
from hil_sim.seeds import generator
from hil_sim.trials import without_effects

ALPHA = np.array([0.06929, 0.04217, 0.04416, 0.06510, 0.07389])  # [D] Table VI
LENGTHS = (0.254, 0.2667)
NOISES = ("mixed", "white", "ar", "pink", "speed", "student")


@dataclass(frozen=True)
class Size:
    """How large a study is."""

    free: int
    loads: int
    per_load: int
    duration_s: float


FULL = Size(free=6, loads=3, per_load=3, duration_s=50.0)
SMALL = Size(free=2, loads=1, per_load=2, duration_s=30.0)


def random_scenario(
    seed: int,
    size: Size,
    effects: tuple[str, ...],
    strength: float,
    *,
    noise: str = "mixed",
    force_sensor: bool = True,
    counts_per_rev: int | None = None,
    weighed: bool = False,
    torque_quantum_Nm: float | None = None,
) -> tuple[Scenario, dict[str, float]]:
    """A study of a random laboratory in good order, except for these effects.

    Args:
        seed: decides everything.
        size: of the study.
        effects: "name@place", or more of it; see hil_sim.scenarios.random_effects.
        strength: of each effect by itself, over the noise floor; see hil_sim.effects.strength. An effect
            whose label states its size has that.
        noise: of the logged torque, one of NOISES: white and a little autoregressive, or one kind alone;
            `speed` is white noise beside some that grows with the joint's speed, `student` has heavy tails.
        force_sensor: whether the robot has one.
        counts_per_rev: of both encoders; None: the 400 000 of [D].
        weighed: trial.toml states the payloads' masses.
        torque_quantum_Nm: the logged torque comes in steps of this; None: of 2 mN m.

    Returns:
        The scenario, and the strength that each effect reached.

    Raises:
        SimError: an effect, place or noise is not known.
    """
    rng = generator(seed, "random study")
    content = _laboratory(rng, size)
    if noise != "mixed":
        content["world"]["torque_log"]["noise"] = _torque_noise(noise, generator(seed, "torque noise", noise))
    if counts_per_rev is not None:
        content["setup"]["encoder"]["counts_per_rev"] = (counts_per_rev, counts_per_rev)
    if not force_sensor:
        del content["world"]["force_sensor"]
    if torque_quantum_Nm is not None:
        content["world"]["torque_log"]["quantum_Nm"] = (torque_quantum_Nm, torque_quantum_Nm)
    if weighed:
        for trial in content["trials"]:
            if "load" in trial:
                trial["payload_kg"] = content["world"]["loads"][trial["load"]]["M_kg"][0][0]
    clean = Scenario.model_validate(content)
    reached = {}
    content["effects"] = []
    for label in effects:
        entry, sized = drawn(label, clean, generator(seed, "random study", label))
        trials = [Clean.of(without_effects(clean, trial, seed)) for trial in _witnesses(entry, clean)]
        if sized:
            reached[label] = measured((entry,), trials)
        else:
            entry, reached[label] = scaled_to(entry, strength, trials)
        content["effects"].append(
            {
                "effect": entry.effect,
                "where": list(entry.where),
                "when": entry.when,
                "trials": list(entry.trials),
                "per_trial": entry.per_trial,
                **entry.values,
            }
        )
    return Scenario.model_validate(content), reached


def _witnesses(entry: Entry, scenario: Scenario) -> list[Trial]:
    """One free and one loaded trial with the effect, and a free one without it if there is one."""
    loaded = catalogue.ROWS[entry.effect].loaded_only
    kinds: dict[tuple[bool, bool], Trial] = {}
    for trial in scenario.trials:
        present = catalogue.applies(entry, trial.name, loaded=trial.load is not None, load=trial.load)
        if present or (trial.load is None and not loaded):
            kinds.setdefault((trial.load is None, present), trial)
    return list(kinds.values())


def _laboratory(rng: np.random.Generator, size: Size) -> dict[str, Any]:
    turn = float(rng.uniform(-np.pi, np.pi))
    loads = {f"spring_L{number}": _load(rng) for number in range(1, size.loads + 1)}
    trials: list[dict[str, Any]] = [{"name": f"free_{n:02}", "kind": "free"} for n in range(1, size.free + 1)]
    trials += [
        {"name": f"{load}_{n:02}", "kind": "mass-spring", "load": load}
        for load in loads
        for n in range(1, size.per_load + 1)
    ]
    for trial in trials:
        trial |= {"duration_s": size.duration_s, "robot_zero_s": round(float(rng.uniform(0.0, 100.0)), 3)}
    return {
        "format": "impid-scenario/1",
        "title": "A random laboratory",
        "setup": {
            "robot": {"link_lengths_m": LENGTHS},
            "encoder": {
                "counts_per_rev": (400000, 400000),
                "zero_rad": tuple(rng.uniform(-0.5, 0.5, 2).tolist()),
                "direction": tuple(int(sign) for sign in rng.choice([-1, 1], 2)),
            },
            "accelerometer": {
                "vref_V": 3.3,
                "zero_g_V": tuple((1.65 + rng.uniform(-0.03, 0.03, 2)).tolist()),
                "sensitivity_V_per_g": tuple((0.62 * (1.0 + rng.uniform(-0.03, 0.03, 2))).tolist()),
                "mount_angle_rad": turn,
            },
        },
        "world": {
            "robot": {"alpha": tuple(_alpha(rng))},
            "force_sensor": {"noise_N": (0.05, 0.05)},
            "torque_log": {
                "noise": [
                    {"kind": "white", "rms": tuple(rng.uniform(0.01, 0.04, 2).tolist())},
                    {"kind": "ar", "rms": tuple(rng.uniform(0.003, 0.01, 2).tolist()), "corner_Hz": 5.0},
                ],
                "quantum_Nm": (0.002, 0.002),
            },
            "adc": {"noise_lsb": 0.5},
            "clocks": {
                "board_ppm": float(rng.uniform(-60.0, 60.0)),
                "robot_ppm": float(rng.uniform(-100.0, 100.0)),
            },
            "loads": loads,
        },
        "motion": {"free_centre_rad": tuple((0.7854 + rng.uniform(-0.15, 0.15, 2)).tolist())},
        "trials": trials,
    }


def _torque_noise(kind: str, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Noise of one kind, about as large below 4.5 Hz as the mixture's."""

    def source(of: str, low: float, high: float, **more: float) -> dict[str, Any]:
        return {"kind": of, "rms": tuple(rng.uniform(low, high, 2).tolist()), **more}

    if kind == "white":
        return [source("white", 0.02, 0.08)]
    if kind == "ar":
        return [source("ar", 0.004, 0.012, corner_Hz=float(rng.uniform(1.0, 8.0)))]
    if kind == "pink":
        return [source("pink", 0.005, 0.015)]
    if kind == "student":
        return [source("student", 0.02, 0.08)]
    if kind == "speed":
        return [source("white", 0.01, 0.03), source("speed", 0.03, 0.1)]
    raise SimError(f"noise {kind}: not known; use one of {', '.join(NOISES)}")


def _alpha(rng: np.random.Generator) -> list[float]:
    """[D] Table VI, each 30 % more or less, as far as a robot can have that inertia."""
    while True:
        alpha = ALPHA * rng.uniform(0.7, 1.3, 5)
        if 0.25 * alpha[1] ** 2 < 0.5 * alpha[0] * alpha[2]:
            return [float(value) for value in alpha]


def _load(rng: np.random.Generator) -> dict[str, Any]:
    """Payload and springs as far apart as those of [D] Table I."""
    m, ks = float(rng.uniform(0.5, 1.5)), float(rng.uniform(-70.0, 70.0))
    kxx, kyy = (float(k) for k in rng.uniform(190.0, 480.0, 2))
    place = np.array([rng.uniform(0.33, 0.39), rng.uniform(-0.06, 0.05)])
    joint_angles(place, LENGTHS)  # within reach
    return {
        "M_kg": ((m, 0.0), (0.0, m)),
        "K_N_per_m": ((kxx, ks), (ks, kyy)),
        "x0_m": tuple(place.tolist()),
    }
