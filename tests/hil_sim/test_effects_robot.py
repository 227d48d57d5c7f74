"""What hangs on the robot, against energy, closed forms and equivalent robots."""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.effects import catalogue
from hil_sim.plant.kinematics import position
from hil_sim.plant.physics import BUMP, RIPPLE, SPRING, Coupled, PlantEffects, Term
from hil_sim.plant.plant import Load, Plant
from hil_sim.scenarios.load import load, trial
from hil_sim.trials import without_effects

FROM = np.array([0.9, 0.2])
WITH = np.array([2.0, -3.0])


def run(parameters, effects, seconds=3.0):
    """The robot set free; motion, and kinetic energy at the end."""
    plant = Plant(replace(parameters, effects=effects), FROM)
    plant.set_speed(WITH)
    before = plant.energy()
    motion = plant.run(np.zeros((round(1000 * seconds), 4)))
    return motion, plant.energy() - before


def conserved(frictionless, effects, potential):
    """Kinetic energy plus this potential of the joint angles stays."""
    motion, gained = run(frictionless, effects)
    spent = potential(motion.q[-1]) - potential(FROM)
    assert abs(spent) > 0.005
    assert gained == pytest.approx(-spent, abs=2e-6)


def test_cartesian_springs_store_what_the_robot_loses(frictionless):
    K, rest = np.array([[40.0, 5.0], [5.0, 15.0]]), np.array([0.37, 0.02])
    effects = PlantEffects(tip_stiffness=tuple(K.ravel()), tip_pull=tuple(K @ rest))

    def potential(q):
        d = position(q, frictionless.link_lengths_m) - rest
        return 0.5 * d @ K @ d

    conserved(frictionless, effects, potential)


def test_joint_springs_ripple_and_bump_are_potentials_of_the_angle(frictionless):
    conserved(
        frictionless,
        PlantEffects(terms=(Term(SPRING, 1, 1.2, 0.5, 0.0),)),
        lambda q: 0.5 * 1.2 * (q[1] - 0.5) ** 2,
    )
    turn = 2.0 * np.pi * 3.0
    conserved(
        frictionless,
        PlantEffects(terms=(Term(RIPPLE, 0, 0.5, 3.0, 1.0),)),
        lambda q: -0.5 / turn * np.cos(turn * q[0] + 1.0),
    )
    fine = np.linspace(-3.0, 60.0, 400_001)
    table = np.cumsum(0.4 * np.exp(-0.5 * ((fine - 1.5) / 0.05) ** 2)) * (fine[1] - fine[0])
    conserved(
        frictionless,
        PlantEffects(terms=(Term(BUMP, 0, 0.4, 1.5, 0.05),)),
        lambda q: np.interp(q[0], fine, table),
    )


def test_gravity_is_a_potential_of_links_and_payload(frictionless):
    g, moment, mass = np.array([1.5, -2.0]), (0.27, 0.08), 0.7
    payload = Load(M=mass * np.eye(2), B=np.zeros((2, 2)), K=np.zeros((2, 2)), x0=np.zeros(2))

    def potential(q):
        links = moment[0] * np.array([np.cos(q[0]), np.sin(q[0])])
        links = links + moment[1] * np.array([np.sin(q[1]), -np.cos(q[1])])
        return -g @ (links + mass * position(q, frictionless.link_lengths_m))

    conserved(replace(frictionless, load=payload), PlantEffects(gravity=tuple(g), moment=moment), potential)


def test_a_damper_at_the_tip_takes_what_its_power_says(frictionless):
    B = np.array([[2.0, 0.3], [0.3, 4.0]])
    motion, gained = run(frictionless, PlantEffects(tip_damping=tuple(B.ravel())), 0.5)
    q, w = np.vstack([FROM, motion.q]), np.vstack([WITH, motion.w])
    l1, l2 = frictionless.link_lengths_m
    v = np.stack(
        [
            -l1 * np.sin(q[:, 0]) * w[:, 0] + l2 * np.cos(q[:, 1]) * w[:, 1],
            l1 * np.cos(q[:, 0]) * w[:, 0] + l2 * np.sin(q[:, 1]) * w[:, 1],
        ],
        axis=1,
    )
    assert gained == pytest.approx(-np.trapezoid(np.einsum("ni,ij,nj->n", v, B, v), dx=125e-6), rel=1e-5)
    assert gained < -0.1


def test_a_mass_ahead_of_the_sensor_moves_the_robot_as_a_payload_behind_it_does(frictionless):
    """inertia.extra is put into alpha: the same mass as a load must give the same motion, but a force too."""
    scenario = load("first-light")
    truth = without_effects(scenario, trial(scenario, "free_01"), 1)
    truth = replace(truth, plant=frictionless)
    entry = catalogue.entry("inertia.extra", ("tip",), (), {"mass": 0.4})
    extra, _ = run(catalogue.apply(truth, (entry,)).plant, None)
    payload = Load(M=0.4 * np.eye(2), B=np.zeros((2, 2)), K=np.zeros((2, 2)), x0=np.zeros(2))
    loaded, _ = run(replace(frictionless, load=payload), None)
    assert extra.q == pytest.approx(loaded.q, abs=1e-9)
    assert not extra.force.any()
    assert loaded.force.any()


def coupled(parameters, **effects):
    """Joint 1 alone (alpha2 = 0) with inertia 0.05, and effects."""
    return replace(parameters, alpha=(0.05, 0.0, 0.05, 0.0, 0.0), effects=PlantEffects(**effects))


def frequency_Hz(signal):
    """From the zero crossings, interpolated."""
    signal = signal - signal.mean()
    at = np.flatnonzero(np.diff(np.sign(signal)) > 0)
    crossing = at - signal[at] / (signal[at + 1] - signal[at])
    return 8000.0 * (crossing.size - 1) / (crossing[-1] - crossing[0])


def test_motor_and_link_swing_at_the_frequency_of_two_masses_on_a_spring(parameters):
    """f = sqrt(k (1 / J + 1 / I)) / 2 pi, and the momentum J phi' + I q' stays."""
    spring = Coupled(inertia=0.01, stiffness=100.0, damping=0.0)
    plant = Plant(coupled(parameters, motor=(spring, Coupled())), FROM)
    plant.set_speed(np.array([1.0, 0.0]))
    motion = plant.run(np.zeros((2000, 4)))
    assert frequency_Hz(motion.w[:, 0]) == pytest.approx(
        np.sqrt(100.0 * (1 / 0.01 + 1 / 0.05)) / (2 * np.pi), rel=1e-5
    )
    # The common motion carries on with I / (I + J) of the speed.
    assert np.polyfit(np.arange(16000) * 125e-6, motion.q[:, 0], 1)[0] == pytest.approx(0.05 / 0.06, rel=1e-3)


def test_a_stiff_transmission_is_a_robot_with_the_motors_inertia(parameters):
    """Torque on the motor moves both together: q = T t^2 / 2 (I + J)."""
    stiff = Coupled(inertia=0.01, stiffness=2e4, damping=1.0)
    plant = Plant(coupled(parameters, motor=(stiff, Coupled())), FROM)
    pull = np.zeros((500, 6))
    pull[:, 0] = 0.12
    motion = plant.run(np.zeros((500, 4)), pull)
    assert motion.q[-1, 0] - FROM[0] == pytest.approx(0.5 * 0.12 / 0.06 * 0.5**2, rel=1e-4)


def test_a_resonator_rings_at_its_own_frequency_against_a_heavy_link(parameters):
    """Hung on a link it rings at sqrt(k (1 / J + 1 / I)); the decay is that of its damping ratio."""
    omega = 2.0 * np.pi * 4.0
    part = Coupled(inertia=0.01, stiffness=0.01 * omega**2, damping=2 * 0.01 * omega * 0.01)
    plant = Plant(coupled(parameters, resonator=(part, Coupled())), FROM)
    plant.set_speed(np.array([1.0, 0.0]))
    motion = plant.run(np.zeros((4000, 4)))
    assert frequency_Hz(np.diff(motion.w[:, 0])) == pytest.approx(4.0 * np.sqrt(1.2), rel=1e-3)


def test_gain_and_offset_stand_between_command_and_joint(parameters):
    """A commanded 0.3 N m arrives as 1.1 * 0.3 - 0.03: q = T t^2 / 2 I."""
    p = replace(coupled(parameters, gain=(1.1, 1.0), offset=(0.03, 0.0)), kp=(0.0, 0.0), kd=(0.3, 0.0))
    plant = Plant(replace(p, velocity_cutoff_Hz=1e-9), FROM)  # kd sees no speed: torque = kd times reference
    reference = np.zeros((200, 4))
    reference[:, 2] = 1.0
    motion = plant.run(reference)
    assert motion.torque[:, 0] == pytest.approx(0.3)
    assert motion.q[-1, 0] - FROM[0] == pytest.approx(0.5 * 0.3 / 0.05 * 0.2**2, rel=1e-6)
