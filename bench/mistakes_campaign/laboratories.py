"""Random laboratories in good order, as studies in memory: five kinds, and each seed another of its kind."""

import tempfile
import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from impid_host.study.folder import read_study
from impid_host.study.model import Study

from hil_sim.scenarios.random import NOISES, Size, random_scenario
from hil_sim.scenarios.schema import Scenario
from hil_sim.study.write import write_study

STEPS = {"1 kHz": 1, "100 Hz": 10, "50 Hz": 20}


@dataclass(frozen=True)
class Kind:
    """What a laboratory has.

    Attributes:
        force: a force sensor; payload: weighed; loads: how many; arm: the loads are arms.
        counts: of both encoders per turn; step: every so many rows of the robot's log are kept.
        duration_s: of each trial.
    """

    name: str
    force: bool
    payload: bool = False
    loads: int = 1
    arm: bool = False
    counts: int = 400_000
    step: int = 1
    duration_s: float = 20.0


KINDS = (
    Kind("force sensor and weighed payload", force=True, payload=True),
    Kind("neither force sensor nor payload", force=False),
    Kind("an arm with a force sensor", force=True, arm=True),
    Kind("coarse encoders, robot log at 100 Hz, force sensor", force=True, counts=40_000, step=10),
    Kind("two weighed loads, no force sensor", force=False, payload=True, loads=2),
)


def laboratory(
    seed: int, kind: Kind, effects: tuple[str, ...] = (), strength: float = 5.0
) -> tuple[Study, Scenario]:
    """One laboratory's study, and the scenario behind it."""
    size = Size(free=2, loads=kind.loads, per_load=2, duration_s=kind.duration_s)
    scenario, _ = random_scenario(
        seed,
        size,
        effects,
        strength,
        noise=NOISES[seed % len(NOISES)],
        force_sensor=kind.force,
        counts_per_rev=kind.counts,
    )
    content: dict[str, Any] = scenario.model_dump()
    if kind.arm:
        _arms(content, np.random.default_rng((seed, 5)))
    scenario = Scenario.model_validate(content)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        write_study(scenario, Path(folder) / "study", seed)
        study = read_study(Path(folder) / "study")
    return replace(
        study, name=f"{seed}", trials=tuple(_log(trial, kind, scenario) for trial in study.trials)
    ), scenario


def _log(trial: Any, kind: Kind, scenario: Scenario) -> Any:
    if kind.step > 1:
        log = trial.robot
        some = slice(None, None, kind.step)
        trial = replace(
            trial,
            robot=replace(
                log,
                t=log.t[some],
                theta=log.theta[some],
                tau=log.tau[some],
                force=None if log.force is None else log.force[some],
            ),
        )
    if kind.payload and trial.kind == "mass-spring":
        mass = scenario.world.loads[trial.load].M_kg[0][0]
        trial = replace(trial, payload_kg=round(mass, 3))
    return trial


def _arms(content: dict[str, Any], rng: np.random.Generator) -> None:
    """Each load an arm, of sizes as [D] Table IV has them."""
    for load in content["world"]["loads"].values():
        mass, turn = rng.uniform(0.8, 1.8), rng.uniform(-0.2, 0.2)
        load["M_kg"] = ((mass, turn), (turn, mass * rng.uniform(0.7, 1.3)))
        load["B_Ns_per_m"] = (
            (rng.uniform(6, 14), rng.uniform(-2, 2)),
            (rng.uniform(-2, 2), rng.uniform(6, 14)),
        )
        load["K_N_per_m"] = (
            (rng.uniform(150, 400), rng.uniform(-40, 40)),
            (rng.uniform(-40, 40), rng.uniform(150, 400)),
        )
    for trial in content["trials"]:
        if trial["kind"] == "mass-spring":
            trial["kind"] = "arm"
    content["setup"]["handle"] = {"mass_kg": 0.135}


EFFECTS = (
    "",
    "friction.coulomb@joint1+joint2",
    "elastic.cartesian@tip",
    "actuator.gain@joint1",
    "",
    "accel.scale@x",
    "actuator.delay@joint1+joint2",
    "gravity.tilt",
    "load.damping",
    "",
    "elastic.transmission@joint1",
    "encoder.eccentricity@joint2",
    "load.coupling",
    "accel.misalignment",
    "",
    "friction.position@joint2",
    "load.hysteresis",
    "encoder.zero@joint1",
    "clock.drift",
    "",
    "actuator.cogging@joint1",
    "accel.lever_arm",
    "load.stiffness_cubic",
    "inertia.extra@tip",
    "",
    "damping.cartesian@tip",
    "load.drift",
    "elastic.joint@joint2",
    "friction.asymmetric@joint1",
    "",
    "actuator.offset@joint1+joint2",
    "load.delay",
    "outside.one_trial",
    "accel.bias@y",
    "outside.push",
)
STRENGTHS = (2.0, 4.0, 8.0)
DURATIONS_S = (20.0, 30.0, 8.0, 12.0)
LOG_STEPS = (1, 1, 2, 10, 50)


def in_order(seed: int) -> tuple[Study, str]:
    """A study without a mistake: any kind, short or long, any log rate, often with an effect hidden."""
    kind = KINDS[seed % len(KINDS)]
    kind = replace(
        kind,
        duration_s=DURATIONS_S[(seed // 5) % len(DURATIONS_S)],
        step=LOG_STEPS[(seed // 3) % len(LOG_STEPS)],
    )
    effect = EFFECTS[seed % len(EFFECTS)]
    if effect == "inertia.extra@tip" and kind.payload:
        effect = ""  # a mass that the scales did not weigh is a mistake
    if kind.arm and effect.startswith("load."):
        effect = ""
    strength = STRENGTHS[(seed // 7) % len(STRENGTHS)]
    study, _ = laboratory(seed, kind, (effect,) if effect else (), strength)
    return (
        study,
        f"{kind.name}; {kind.duration_s:g} s, every {kind.step}; {effect or 'nothing hidden'} x {strength:g}",
    )
