"""What a scenario hides, as JSON: for whoever checks an identification, never for the host."""

from typing import Any

from hil_sim.scenarios.schema import Scenario, Trial
from hil_sim.sensors.clock import Clock

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
    entry: Json = {"kind": trial.kind, "duration_s": trial.duration_s}
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
        "trials": {trial.name: trial_json(scenario, trial, begin_us.get(trial.name)) for trial in trials},
    }
