"""Each effect of the catalogue changes what it should, and nothing else.

A trial is run with and without the effect and the same chance; then the columns are compared of which a study
is made: what the board converts and counts, and what the robot logs.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hil_sim.effects import catalogue
from hil_sim.scenarios.load import load, trial
from hil_sim.trials import without_effects
from hil_sim.world import World

ALL = {"adc", "count", "theta", "tau", "force"}
MOTION = "everything, because the robot moves otherwise"
# What an effect changes in free motion, where that is less than under load: alpha knows no lengths, and there
# is no force to misread.
IN_FREE_MOTION = {
    "geometry.link_length": {"adc"},
    "force.scale": set(),
    "force.misalignment": set(),
    "force.cross_axis": set(),
    "force.delay": set(),
}
EXAMPLES: dict[str, tuple[dict[str, Any], object]] = {
    "friction.coulomb": ({"torque": 0.05}, MOTION),
    "friction.stribeck": ({"torque": 0.05, "speed": 0.3}, MOTION),
    "friction.asymmetric": ({"torque_pos": 0.05, "torque_neg": 0.02}, MOTION),
    "friction.quadratic": ({"coefficient": 0.02}, MOTION),
    "friction.position": ({"amplitude": 0.02, "period_rad": 0.3, "phase_rad": 0.0}, MOTION),
    "friction.load": ({"coefficient": 0.1}, MOTION),
    "friction.presliding": ({"torque": 0.05, "width_rad": 0.01}, MOTION),
    "gravity.link": ({"torque_sin": 0.05}, MOTION),
    "actuator.lag": ({"time_constant": 0.005}, MOTION),
    "load.time_varying": ({"K": 40.0}, MOTION),
    "outside.torque_constant": ({"fade": 0.1, "time_s": 2.0}, MOTION),
    "outside.capstan_creep": ({"coefficient": 0.02}, MOTION),
    "outside.cable_hysteresis": ({"force": 1.0, "width": 0.01}, MOTION),
    "outside.bracket": ({"share": 0.1, "frequency_Hz": 4.0}, {"adc"}),
    "elastic.cartesian": ({"kx": 30.0, "ky": 10.0}, MOTION),
    "elastic.joint": ({"stiffness": 1.0, "rest_rad": 0.5}, MOTION),
    "elastic.transmission": ({"stiffness": 50.0, "motor_inertia": 0.01}, MOTION),
    "damping.cartesian": ({"bx": 2.0, "by": 1.0}, MOTION),
    "gravity.tilt": ({"gx": 0.1, "gy": -0.1}, MOTION),
    "inertia.extra": ({"mass": 0.1}, MOTION),
    "actuator.gain": ({"gain": 1.05}, MOTION),
    "actuator.offset": ({"torque": 0.05}, MOTION),
    "actuator.cogging": ({"amplitude": 0.05, "cycles_per_rad": 3.0, "phase_rad": 0.0}, MOTION),
    "actuator.delay": ({"delay": 0.004}, {"tau"}),
    "accel.misalignment": ({"angle_rad": 0.05}, {"adc"}),
    "accel.scale": ({"gain": 1.05}, {"adc"}),
    "accel.bias": ({"bias": 0.2}, {"adc"}),
    "accel.cross_axis": ({"cross": 0.05}, {"adc"}),
    "accel.delay": ({"delay": 0.01}, {"adc"}),
    "accel.lever_arm": ({"lever": [0.02, -0.01]}, {"adc"}),
    "encoder.eccentricity": ({"amplitude_rad": 0.01, "phase_rad": 0.5}, MOTION),
    "encoder.zero": ({"zero_rad": 0.01}, MOTION),
    "encoder.scale": ({"factor": 1.01}, MOTION),
    "geometry.link_length": ({"length_m": 0.26}, MOTION),
    "force.scale": ({"gain": 1.05}, {"force"}),
    "force.misalignment": ({"angle_rad": 0.05}, {"force"}),
    "force.cross_axis": ({"cross": 0.05}, {"force"}),
    "force.bias": ({"bias": 0.2}, {"force"}),
    "force.delay": ({"delay": 0.005}, {"force"}),
    "clock.drift": ({"seconds": 0.005}, {"adc", "count"}),
    "load.damping": ({"B": 2.0}, MOTION),
    "load.stiffness_cubic": ({"cubic": 2e5}, MOTION),
    "load.hysteresis": ({"amplitude": 0.5, "width": 0.002}, MOTION),
    "load.deadzone": ({"width": 0.004}, MOTION),
    "load.delay": ({"delay": 0.05, "gain_k": 30.0, "gain_b": 1.0}, MOTION),
    "load.drift": ({"rate": [1e-3, 0.0]}, MOTION),
    "load.coupling": ({"K": [[0.0, 30.0], [-30.0, 0.0]]}, MOTION),
    "outside.torque_bump": ({"torque": 0.1, "centre_rad": 0.8, "width_rad": 0.03}, MOTION),
    "outside.resonance": ({"inertia": 0.01, "frequency_Hz": 4.0}, MOTION),
    "outside.periodic": ({"torque": 0.05, "frequency_Hz": 1.0}, MOTION),
    "outside.random_walk": ({"torque_per_root_s": 0.05}, MOTION),
    "outside.warm_up": ({"viscous": 0.05, "time_s": 5.0}, MOTION),
    "outside.load_friction": ({"coefficient": 0.01}, MOTION),
    "outside.torque_clipped": ({"torque": 0.3}, {"tau"}),
    "outside.torque_quantised": ({"torque": 0.3}, {"tau"}),
    "outside.torque_stuck": ({"every_s": 0.5, "for_s": 0.2}, {"tau"}),
    "outside.push": ({"force": [3.0, 0.0], "start_s": 1.0, "duration_s": 1.0}, MOTION),
    "outside.one_trial": ({"viscous_factor": 1.5}, MOTION),
}


def test_every_effect_has_an_example():
    assert set(EXAMPLES) == set(catalogue.ROWS)


def clean(name):
    """A trial of first-light, 3 s of it, without noise in the log."""
    scenario = load("first-light")
    short = trial(scenario, name).model_copy(update={"duration_s": 3.0})
    truth = without_effects(scenario, short, 3)
    return replace(truth, log=replace(truth.log, noise=(), quantum_Nm=(0.0, 0.0)))


def columns(truth):
    world = World(truth)
    world.begin(10_000)
    readings = world.read(0, 3100)
    rows = world.take_log()
    return {
        "adc": readings.adc,
        "count": readings.encoder,
        "t": np.concatenate([part.t_s for part in rows]),
        "theta": np.concatenate([part.theta_rad for part in rows]),
        "tau": np.concatenate([part.tau_Nm for part in rows]),
        "force": np.concatenate([part.force_N for part in rows]),
    }


@pytest.fixture(scope="module")
def without():
    return {name: columns(clean(name)) for name in ("free_01", "spring_K1_M1_01")}


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_effect_changes_what_it_should_and_nothing_else(without, name):
    values, changes = EXAMPLES[name]
    row = catalogue.ROWS[name]
    entry = catalogue.entry(name, row.places[:1], (), values)
    for trial_name in without:
        if not catalogue.applies(entry, trial_name, loaded=trial_name != "free_01"):
            continue
        found = columns(catalogue.apply(clean(trial_name), (entry,)))
        changed = {
            key
            for key, column in without[trial_name].items()
            if column.shape != found[key].shape or not np.array_equal(column, found[key])
        }
        if trial_name == "free_01" and name in IN_FREE_MOTION:
            assert changed == IN_FREE_MOTION[name]
        elif changes is MOTION:
            # In free motion the sensor still feels no force, unless somebody pushes or the plane is inclined.
            assert changed | {"force"} == ALL
            if trial_name == "free_01" and name != "outside.push":
                assert "force" not in changed
        else:
            assert changed == changes


@pytest.mark.parametrize("name", [name for name, row in catalogue.ROWS.items() if row.loaded_only])
def test_effects_of_the_load_are_not_in_free_trials(name):
    entry = catalogue.entry(name, (), (), EXAMPLES[name][0])
    assert not catalogue.applies(entry, "free_01", loaded=False)
    assert catalogue.applies(entry, "spring", loaded=True)


def test_several_effects_add_up(without):
    """Two that only touch the log and the sensor: together they do what each does."""
    one = catalogue.entry("accel.scale", ("x",), (), {"gain": 1.05})
    other = catalogue.entry("actuator.delay", ("joint2",), (), {"delay": 0.004})
    both = columns(catalogue.apply(clean("free_01"), (one, other)))
    assert np.array_equal(both["adc"], columns(catalogue.apply(clean("free_01"), (one,)))["adc"])
    assert np.array_equal(both["tau"], columns(catalogue.apply(clean("free_01"), (other,)))["tau"])
    assert np.array_equal(both["tau"][:, 0], without["free_01"]["tau"][:, 0])


def test_a_trial_begins_in_balance():
    """The drive held the spring before the trial: the first row of the log already shows its torque."""
    values = {"stiffness": 2.0, "rest_rad": 0.5}
    found = columns(catalogue.apply(clean("free_01"), (catalogue.entry("elastic.joint", (), (), values),)))
    first = found["tau"][:20, 0]
    assert first == pytest.approx(2.0 * (found["theta"][0, 0] - 0.5), abs=0.06)
    assert np.ptp(found["theta"][:20, 0]) < 1e-4
