"""What a scenario hides, as JSON: for whoever checks an identification, never for the host."""

import math
from typing import Any

from hil_sim.effects import catalogue
from hil_sim.scenarios.schema import NoiseTable, Scenario, TorqueNoiseTable, Trial
from hil_sim.sensors.accelerometer import STANDARD_GRAVITY
from hil_sim.sensors.clock import Clock
from hil_sim.trials import effects_in

Json = dict[str, Any]


def clock_truth(scenario: Scenario, trial: Trial, begin_us: int) -> Json:
    """How the robot's clock follows from the board's in one trial whose motion began at board time begin_us.

    robot_s = robot_s_at_board_zero + (1 + drift_ppm / 1e6) board_s
    """
    clocks = scenario.world.clocks
    rate = Clock(0.0, clocks.robot_ppm).rate / Clock(0.0, clocks.board_ppm).rate
    begin_s = 1e-6 * begin_us
    return {
        "board_us_at_start": begin_us,
        "robot_s_at_start": trial.robot_zero_s,
        "robot_s_at_board_zero": trial.robot_zero_s - rate * begin_s,
        "drift_ppm": 1e6 * (rate - 1.0),
    }


def trial_json(scenario: Scenario, trial: Trial, begin_us: int | None) -> Json:
    """One trial: its load, and its clocks once it is known when it began."""
    entry: Json = {
        "kind": trial.kind,
        "duration_s": trial.duration_s,
        "effects": [f"{one.effect}@{'+'.join(one.where)}" for one in effects_in(scenario, trial)],
    }
    if trial.load is not None:
        load = scenario.world.loads[trial.load]
        entry["load"] = {
            "name": trial.load,
            "M": load.M_kg,
            "B": load.B_Ns_per_m,
            "K": load.K_N_per_m,
            "x0": load.x0_m,
        }
    if begin_us is not None:
        entry["clock"] = clock_truth(scenario, trial, begin_us)
    return entry


def effects_json(scenario: Scenario, trials: tuple[Trial, ...]) -> list[Json]:
    """What is hidden: name, place, parameters, and in which of these trials."""
    present: dict[str, Json] = {}
    for trial in trials:
        for one in effects_in(scenario, trial):
            row = catalogue.ROWS[one.effect]
            units = {parameter.name: parameter.unit for parameter in row.parameters}
            parameters = {k: {"value": v, "unit": units[k]} for k, v in one.values.items()}
            for name, values in one.per_trial.items():
                for k, v in values.items():
                    parameters[k].setdefault("per_trial", {})[name] = v
            key = repr((one.effect, one.where, one.when, one.trials, sorted(one.values.items(), key=str)))
            there = {
                "effect": one.effect,
                "where": list(one.where),
                "when": list(one.trials) or one.when,
                "parameters": parameters,
                "trials": [],
            }
            present.setdefault(key, there)["trials"].append(trial.name)
    return list(present.values())


def noise_json(scenario: Scenario) -> Json:
    """The noise floor: all that chance adds to what is logged, as standard deviations of single values."""
    world = scenario.world
    sensor, accelerometer = world.force_sensor, world.accelerometer
    adc_step = (
        scenario.setup.accelerometer.vref_V / 4096 / scenario.setup.accelerometer.sensitivity_V_per_g[0]
    )
    return {
        "torque_Nm": [noise.model_dump() for noise in world.torque_log.noise],
        "torque_rms_Nm": _total([noise.rms for noise in world.torque_log.noise if _absolute(noise)]),
        "torque_quantum_Nm": world.torque_log.quantum_Nm,
        "force_N": []
        if sensor is None
        else [{"kind": "white", "rms": sensor.noise_N}, *(noise.model_dump() for noise in sensor.noise)],
        "force_rms_N": None
        if sensor is None
        else _total([sensor.noise_N, *(noise.rms for noise in sensor.noise if _absolute(noise))]),
        "acceleration_ug_per_rtHz": accelerometer.noise_density_ug_per_rtHz,
        "adc_step_m_s2": STANDARD_GRAVITY * adc_step,
        "encoder_step_rad": [2.0 * math.pi / count for count in scenario.setup.encoder.counts_per_rev],
    }


def _absolute(noise: NoiseTable | TorqueNoiseTable) -> bool:
    return noise.kind in ("white", "ar", "pink", "student")


def _total(rms: list[tuple[float, float]]) -> tuple[float, float]:
    return math.hypot(*(one[0] for one in rms)), math.hypot(*(one[1] for one in rms))


def scenario_json(scenario: Scenario, seed: int, begin_us: dict[str, int], trials: tuple[Trial, ...]) -> Json:
    """The truth of these trials; begin_us holds the board time at which each known one began.

    A trial that is missing there has only the clocks' rates: its start is not decided yet.
    """
    clocks = scenario.world.clocks
    return {
        "format": "impid-truth/1",
        "seed": seed,
        "unit": "SI",
        "robot": {"alpha": scenario.world.robot.alpha, "link_lengths_m": scenario.setup.robot.link_lengths_m},
        "clocks": {"board_ppm": clocks.board_ppm, "robot_ppm": clocks.robot_ppm},
        "accelerometer": scenario.world.accelerometer.model_dump(),
        "effects": effects_json(scenario, trials),
        "noise_floor": noise_json(scenario),
        "trials": {trial.name: trial_json(scenario, trial, begin_us.get(trial.name)) for trial in trials},
    }
