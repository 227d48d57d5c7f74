"""Instruments and declared constants that err, by what is logged against what each error's equation says."""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.effects import catalogue
from hil_sim.effects.geometry import declared_length_m
from hil_sim.errors import SimError
from hil_sim.plant.kinematics import joint_angles, position
from hil_sim.plant.plant import Load, Plant
from hil_sim.scenarios.load import load, trial
from hil_sim.sensors.force_sensor import ForceSensorTruth
from hil_sim.trials import without_effects
from hil_sim.world import World

SECONDS = 4.0


def quiet(name="spring_K1_M1_01"):
    """A trial of first-light without noise."""
    scenario = load("first-light")
    truth = without_effects(scenario, trial(scenario, name).model_copy(update={"duration_s": SECONDS}), 5)
    log = replace(truth.log, noise=(), quantum_Nm=(0.0, 0.0))
    return replace(truth, log=log, force_sensor=ForceSensorTruth(noise=()))


def with_effect(truth, name, values, where=()):
    return catalogue.apply(truth, (catalogue.entry(name, where, (), values),))


def logged(truth):
    """Rows of the robot's log, and counters of the board at every millisecond of its clock."""
    world = World(truth)
    world.begin(10_000)
    readings = world.read(0, round(1000 * SECONDS) + 100)
    rows = world.take_log()
    return {
        "t": np.concatenate([part.t_s for part in rows]) - truth.robot_clock.zero_s,
        "theta": np.concatenate([part.theta_rad for part in rows]),
        "force": np.concatenate([part.force_N for part in rows]),
        "count": readings.encoder,
    }


@pytest.fixture(scope="module")
def true_force():
    return logged(quiet())["force"]


@pytest.mark.parametrize(
    ("where", "gain", "factor"),
    [(("sensor",), 1.05, [1.05, 1.05]), (("y",), 0.9, [1.0, 0.9]), (("x", "y"), [1.1, 0.8], [1.1, 0.8])],
)
def test_a_force_sensors_gain_multiplies_its_axes(true_force, where, gain, factor):
    found = logged(with_effect(quiet(), "force.scale", {"gain": gain}, where))["force"]
    assert found == pytest.approx(true_force * factor, rel=1e-12)


def test_a_force_sensor_turned_counter_clockwise_sees_the_force_turned_clockwise(true_force):
    found = logged(with_effect(quiet(), "force.misalignment", {"angle_rad": 0.3}))["force"]
    seen = (true_force[:, 0] + 1j * true_force[:, 1]) * np.exp(-0.3j)
    assert found[:, 0] + 1j * found[:, 1] == pytest.approx(seen, rel=1e-12)


def test_cross_talk_adds_a_share_of_the_other_axis(true_force):
    found = logged(with_effect(quiet(), "force.cross_axis", {"cross": 0.1}, ("x",)))["force"]
    assert found[:, 0] == pytest.approx(true_force[:, 0] + 0.1 * true_force[:, 1], rel=1e-12)
    assert found[:, 1] == pytest.approx(true_force[:, 1])


def test_a_zero_that_drifts_is_the_bias_in_the_middle_of_the_trial():
    found = logged(with_effect(quiet("free_01"), "force.bias", {"bias": [0.5, -0.2], "drift": [0.0, 0.03]}))
    law = np.stack([np.full(found["t"].size, 0.5), -0.2 + 0.03 * (found["t"] - 0.5 * SECONDS)], axis=1)
    assert found["force"] == pytest.approx(law, abs=1e-12)


@pytest.mark.parametrize("delay", [0.0123, -0.0123])
def test_a_late_force_is_that_of_so_long_ago(true_force, delay):
    found = logged(with_effect(quiet(), "force.delay", {"delay": delay}))
    t = found["t"]
    for axis in (0, 1):
        law = np.interp(t - delay, t, true_force[:, axis])
        inside = (t > 0.1) & (t < SECONDS - 0.1)
        assert found["force"][inside, axis] == pytest.approx(law[inside], abs=2e-2)
        assert abs(found["force"][inside, axis] - true_force[inside, axis]).max() > 0.2


def test_force_errors_need_a_force_sensor():
    with pytest.raises(SimError, match="no force sensor"):
        with_effect(replace(quiet(), force_sensor=None), "force.scale", {"gain": 1.05})


def test_a_robot_of_another_length_moves_the_load_by_its_own_jacobian():
    """The spring's force is that of the true place, while angles and declared lengths give another."""
    truth = with_effect(quiet(), "geometry.link_length", {"length_m": 0.264}, ("joint1",))
    assert truth.plant.link_lengths_m == (0.264, 0.2667)
    assert declared_length_m(truth, "joint1") == 0.254
    found = logged(truth)
    K, M, x0 = truth.plant.load.K, truth.plant.load.M, truth.plant.load.x0

    def residual(lengths):
        x = position(found["theta"], lengths)
        a = np.gradient(np.gradient(x, 1e-3, axis=0), 1e-3, axis=0)
        smooth = np.ones(41) / 41  # derivatives of whole counts
        force = found["force"] + (x - x0) @ K.T + a @ M.T
        return np.stack([np.convolve(c, smooth, "valid") for c in force.T], axis=1)[100:-100]

    assert np.std(residual((0.264, 0.2667))) < 0.05
    assert np.std(residual((0.254, 0.2667))) > 0.3


def test_the_controller_goes_on_with_the_declared_lengths(parameters):
    """A force of 1 N commanded at the end point becomes J' F of the lengths that the controller believes."""
    p = replace(parameters, at_tip=True, believed_lengths_m=(0.3, 0.2))
    q = np.array([0.7, 0.9])
    motion = Plant(p, q).run(np.array([[0.0, 0.0, 1.0, 0.0]]))
    assert motion.torque[0] == pytest.approx([-0.3 * np.sin(q[0]), 0.2 * np.cos(q[1])], abs=1e-4)


def test_alpha_is_that_of_the_robot_whatever_its_links_measure(frictionless):
    """In free motion nothing but alpha counts: another length changes no angle."""
    start, speed = np.array([0.9, 0.2]), np.array([2.0, -3.0])
    turned = []
    for lengths in ((0.254, 0.2667), (0.3, 0.2)):
        plant = Plant(replace(frictionless, link_lengths_m=lengths, load=Load.none()), start)
        plant.set_speed(speed)
        turned.append(plant.run(np.zeros((500, 4))).q)
    assert turned[0] == pytest.approx(turned[1], abs=1e-12)


def counted(truth):
    """What setup.toml makes of the board's counters, and the robot's log at the same instants."""
    found = logged(truth)
    declared = truth.encoder.angle(found["count"])
    start = joint_angles(truth.plant.load.x0, truth.plant.declared_lengths_m)
    return declared, found["theta"], start


def test_fewer_counts_per_turn_than_declared_make_angles_small():
    """Declared angle = true angle / factor from count 0, for board and log alike."""
    truth = with_effect(quiet(), "encoder.scale", {"factor": 1.02}, ("joint2",))
    declared, theta, start = counted(truth)
    assert declared[0] == pytest.approx(start, abs=2e-3)
    assert theta[0] == pytest.approx(start, abs=2e-3)
    q = np.array([[0.4, 0.5], [0.7, -0.3]])
    seen = truth.encoder.angle(truth.encoder.count(q))
    assert seen == pytest.approx(q / [1.0, 1.02], abs=2e-5)
    plant = Plant(truth.plant, q[0])
    assert plant.run(np.zeros((1, 4))).count[0] == pytest.approx(truth.encoder.count(q)[0])


def test_where_setup_alone_is_wrong_the_robots_log_is_right():
    values = {"factor": 1.02, "believed_by": "setup"}
    truth = with_effect(quiet(), "encoder.scale", values, ("joint1",))
    declared, theta, start = counted(truth)
    assert theta[0] == pytest.approx(start, abs=2e-3)
    assert declared[0] == pytest.approx(start / [1.02, 1.0], abs=2e-3)
