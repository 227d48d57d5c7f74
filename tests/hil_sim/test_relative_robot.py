"""A robot whose second joint is relative is the same two links, seen and driven otherwise."""

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.signal import butter, sosfiltfilt

from hil_sim.effects import catalogue
from hil_sim.errors import SimError
from hil_sim.plant.kinematics import joints_of, links_of, position
from hil_sim.plant.physics import PlantEffects
from hil_sim.plant.plant import Plant
from hil_sim.scenarios.load import load, trial
from hil_sim.scenarios.schema import Scenario
from hil_sim.sensors.force_sensor import ForceSensorTruth
from hil_sim.trials import without_effects
from hil_sim.world import World

FROM = np.array([0.9, 1.4])


def free(parameters, pull):
    plant = Plant(parameters, FROM)
    plant.set_speed(np.array([1.0, -0.5]))
    inputs = np.zeros((500, 6))
    inputs[:, :2] = pull
    return plant.run(np.zeros((500, 4)), inputs)


def test_joint_angles_are_those_of_a_planar_arm():
    """x = l1 cos p1 + l2 cos(p1 + p2), y = l1 sin p1 + l2 sin(p1 + p2)."""
    p = np.array([[0.3, 0.8], [-1.0, 2.0], [0.0, 0.0]])
    l1, l2 = 0.3, 0.2
    both = p[:, 0] + p[:, 1]
    law = np.stack(
        [l1 * np.cos(p[:, 0]) + l2 * np.cos(both), l1 * np.sin(p[:, 0]) + l2 * np.sin(both)], axis=1
    )
    assert position(links_of(p, relative=True), (l1, l2)) == pytest.approx(law)
    assert joints_of(links_of(p, relative=True), relative=True) == pytest.approx(p)


def test_a_torque_between_the_links_pushes_the_first_one_back(frictionless):
    absolute = replace(frictionless, effects=PlantEffects())
    relative = replace(absolute, relative=True)
    one = free(relative, [0.2, 0.1])
    other = free(absolute, [0.2 - 0.1, 0.1])
    assert one.q == pytest.approx(other.q, abs=1e-12)


def test_friction_of_the_second_joint_brakes_the_links_against_each_other(frictionless):
    """Power lost: b1 w1^2 + b2 (w2 - w1)^2; links that turn together feel nothing of the second."""
    p = replace(frictionless, alpha=(*frictionless.alpha[:3], 0.0, 0.3), relative=True)
    plant = Plant(p, FROM)
    plant.set_speed(np.array([1.0, -0.5]))
    before = plant.energy()
    motion = plant.run(np.zeros((500, 4)))
    w = np.vstack([[1.0, -0.5], motion.w])
    lost = np.trapezoid(0.3 * (w[:, 1] - w[:, 0]) ** 2, dx=125e-6)
    assert before - plant.energy() == pytest.approx(lost, rel=1e-6)


def test_encoders_show_the_joints(parameters):
    p = replace(parameters, relative=True)
    motion = Plant(p, FROM).run(np.zeros((1, 4)))
    turn = 2.0 * np.pi / 400_000
    assert motion.count[0] * turn == pytest.approx([0.9, 1.4 - 0.9 - np.pi / 2], abs=turn)


def test_a_force_at_the_end_point_is_what_the_links_jacobian_says(parameters):
    """1 N along y through the arm's own Jacobian: torque = (x, x - x1)."""
    p = replace(parameters, relative=True, at_tip=True)
    motion = Plant(p, FROM).run(np.array([[0.0, 0.0, 0.0, 1.0]]))
    l1, l2 = p.link_lengths_m
    x1 = l1 * np.cos(FROM[0])
    x = x1 + l2 * np.sin(FROM[1])
    assert motion.torque[0] == pytest.approx([x, x - x1], abs=1e-4)


@pytest.fixture(scope="module")
def vertical():
    """Log and readings of the arm in a vertical plane, without noise and without what it hides."""
    scenario = load("vertical-arm")
    found = {}
    for name in ("free_01", "spring_K1_M1_01"):
        short = trial(scenario, name).model_copy(update={"duration_s": 8.0})
        truth = without_effects(scenario, short, 1)
        log = replace(truth.log, noise=(), quantum_Nm=(0.0, 0.0))
        world = World(replace(truth, log=log, force_sensor=ForceSensorTruth(noise=())))
        world.begin(10_000)
        at_rest = world.read(1000, 9).adc.mean(axis=(0, 1))  # the motion begins thereafter
        world.read(10_000, 8100)
        rows = world.take_log()
        found[name] = (
            at_rest,
            *(
                np.concatenate([getattr(part, column) for part in rows])
                for column in ("theta_rad", "tau_Nm", "force_N")
            ),
        )
    return scenario, found


def smooth(values):
    low = butter(4, 5.0, fs=1000.0, output="sos")
    return sosfiltfilt(low, values, axis=0)[1000:-1000]


def textbook(scenario, theta):
    """Torque of a planar arm with relative joints in a vertical plane, as any textbook has it."""
    p1, p2 = theta.T
    w, a = np.gradient(theta, 1e-3, axis=0), np.gradient(np.gradient(theta, 1e-3, axis=0), 1e-3, axis=0)
    a1, a2, a3, b1, b2 = scenario.world.robot.alpha
    m1, m2 = scenario.world.robot.moment_kg_m
    g = -scenario.setup.robot.gravity_m_s2[1]
    c, s = 0.5 * a2 * np.cos(p2), 0.5 * a2 * np.sin(p2)
    second = m2 * g * np.cos(p1 + p2)
    tau1 = (a1 + a3 + 2 * c) * a[:, 0] + (a3 + c) * a[:, 1] - s * (2 * w[:, 0] * w[:, 1] + w[:, 1] ** 2)
    tau2 = (a3 + c) * a[:, 0] + a3 * a[:, 1] + s * w[:, 0] ** 2
    return np.stack(
        [tau1 + b1 * w[:, 0] + m1 * g * np.cos(p1) + second, tau2 + b2 * w[:, 1] + second], axis=1
    )


def test_free_motion_in_a_vertical_plane_is_that_of_the_textbook(vertical):
    scenario, found = vertical
    _, theta, tau, force = found["free_01"]
    missing = smooth(tau - textbook(scenario, theta))
    assert np.std(smooth(tau), axis=0).min() > 0.1
    assert abs(missing).max() < 0.02
    assert not force.any()


def test_the_load_pulls_at_the_end_point_with_its_springs_inertia_and_weight(vertical):
    scenario, found = vertical
    _, theta, tau, force = found["spring_K1_M1_01"]
    l1, l2 = scenario.setup.robot.link_lengths_m
    p1, both = theta[:, 0], theta.sum(axis=1)
    x = np.stack([l1 * np.cos(p1) + l2 * np.cos(both), l1 * np.sin(p1) + l2 * np.sin(both)], axis=1)
    table = scenario.world.loads["spring_K1_M1"]
    M, K, x0 = np.array(table.M_kg), np.array(table.K_N_per_m), np.array(table.x0_m)
    acc = np.gradient(np.gradient(x, 1e-3, axis=0), 1e-3, axis=0)
    law = -(acc - scenario.setup.robot.gravity_m_s2) @ M.T - (x - x0) @ K.T
    assert abs(smooth(force - law)).max() < 0.05
    # J' F, with x' = -l1 sin p1 ... for the first joint and the second link's part for the second.
    turning = np.stack([x[:, 0] * force[:, 1] - x[:, 1] * force[:, 0]] * 2, axis=1)
    elbow = np.stack([l1 * np.cos(p1), l1 * np.sin(p1)], axis=1)
    turning[:, 1] -= elbow[:, 0] * force[:, 1] - elbow[:, 1] * force[:, 0]
    assert abs(smooth(tau + turning - textbook(scenario, theta))).max() < 0.03


def test_a_sensor_on_the_second_link_feels_gravity_along_that_link(vertical):
    """At rest specific force is g upward: sin(p1 + p2) of it along the link, cos across."""
    code, theta, _, _ = vertical[1]["free_01"]
    felt = (code / 4096 * 3.3 - 1.65) / 0.62
    angle = theta[0].sum()
    assert felt == pytest.approx([np.sin(angle), np.cos(angle)], abs=2e-3)


def test_only_a_relative_robot_declares_gravity():
    content = load("first-light").model_dump()
    content["setup"]["robot"]["gravity_m_s2"] = (0.0, -9.8)
    with pytest.raises(ValidationError, match=r"gravity\.tilt"):
        Scenario.model_validate(content)


def test_parts_that_swing_on_the_second_joint_are_refused():
    scenario = load("vertical-arm")
    truth = without_effects(scenario, scenario.trials[0], 1)
    values = {"stiffness": 30.0, "motor_inertia": 0.01}
    entry = catalogue.entry("elastic.transmission", ("joint2",), (), values)
    with pytest.raises(SimError, match="planar-2r-absolute"):
        catalogue.apply(truth, (entry,))


def test_the_weight_of_a_relative_link_goes_with_its_own_angle(frictionless):
    """gravity.link as potential -s cos phi + c sin phi, phi = p1 + p2 for the second link."""
    scenario = load("vertical-arm")
    plant = replace(frictionless, relative=True)
    truth = replace(without_effects(scenario, scenario.trials[0], 1), plant=plant)
    values = {"torque_sin": [0.6, -0.2], "torque_cos": [0.3, 0.5]}
    entry = catalogue.entry("gravity.link", ("joint1", "joint2"), (), values)
    moving = Plant(catalogue.apply(truth, (entry,)).plant, FROM)
    moving.set_speed(np.array([2.0, -3.0]))
    before = moving.energy()
    p = joints_of(np.vstack([FROM, moving.run(np.zeros((2000, 4))).q[-1]]), relative=True)
    phi = np.stack([p[:, 0], p.sum(axis=1)], axis=1)
    potential = -np.cos(phi) @ [0.6, -0.2] + np.sin(phi) @ [0.3, 0.5]
    assert abs(np.diff(potential)[0]) > 0.05
    assert moving.energy() - before == pytest.approx(-np.diff(potential)[0], abs=2e-6)
