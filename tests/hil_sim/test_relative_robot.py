"""A robot whose second joint is relative is the same two links, seen and driven otherwise."""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.plant.kinematics import joints_of, links_of, position
from hil_sim.plant.physics import PlantEffects
from hil_sim.plant.plant import Plant

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
