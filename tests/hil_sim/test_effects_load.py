"""What the load does beyond M, B and K, by the force that the plant reports and by energy."""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.plant.kinematics import joint_angles, position
from hil_sim.plant.physics import JUMP, RAMP, SINE, LoadExtras, PlantEffects
from hil_sim.plant.plant import Load, Plant

X0 = np.array([0.36, 0.01])
K = np.array([[400.0, 20.0], [20.0, 250.0]])
SPRING = Load(M=0.8 * np.eye(2), B=np.zeros((2, 2)), K=K, x0=X0)
NO_SPRING = replace(SPRING, K=np.zeros((2, 2)))


def led(parameters, load, extras, seconds=2.0, inputs=None):
    """The robot leads the load about x0; its motion, and what the load's force is beyond M and K."""
    p = replace(parameters, load=load, effects=PlantEffects(load=extras), kp=(150.0, 150.0), kd=(5.0, 5.0))
    q0 = joint_angles(X0, p.link_lengths_m)
    plant = Plant(p, q0)
    t = np.arange(round(1000 * seconds)) * 1e-3
    swing = np.stack([0.08 * np.sin(7.0 * t), 0.06 * np.sin(11.0 * t)], axis=1)
    motion = plant.run(np.hstack([q0 + swing, np.zeros((t.size, 2))]), inputs)
    x = position(np.vstack([q0, motion.q]), p.link_lengths_m)
    middle = 0.5 * (x[1:] + x[:-1])
    model = -(motion.acceleration @ load.M.T + (middle - X0) @ load.K.T)
    return motion, x, motion.force - model


def middles(x):
    return 0.5 * (x[1:] + x[:-1]) - X0


def test_the_spring_hardens_with_the_cube(parameters):
    _, x, extra = led(parameters, SPRING, LoadExtras(cubic=(2e5, 0.0), cubic_radial=1e5))
    d = middles(x)
    law = -np.stack([2e5 * d[:, 0] ** 3, np.zeros(len(d))], axis=1) - 1e5 * np.sum(d**2, axis=1)[:, None] * d
    assert extra == pytest.approx(law, abs=2e-3)
    assert abs(law).max(axis=0).min() > 0.3


def test_no_spring_pulls_within_the_play(parameters):
    motion, x, _ = led(parameters, SPRING, LoadExtras(play_half=(0.004, 0.003)))
    d = middles(x)
    force = motion.force + motion.acceleration @ SPRING.M.T
    inside = np.all(abs(d) < [0.0038, 0.0028], axis=1)
    assert inside.sum() > 100
    assert abs(force[inside]).max() < 1e-3
    beyond = np.sign(d) * np.maximum(abs(d) - [0.004, 0.003], 0.0)
    assert force == pytest.approx(-beyond @ K.T, abs=5e-3)


def test_hysteresis_follows_dahl_and_takes_its_area(parameters):
    """z relaxes towards the direction of motion as exp(-distance / width), solved exactly by pieces."""
    width, size = 0.002, 0.5
    _, x, extra = led(parameters, NO_SPRING, LoadExtras(dry=(size, size), dry_width=width), 3.0)
    z = np.zeros(2)
    expected = np.zeros_like(extra)
    for row, step in enumerate(np.diff(x, axis=0)):
        towards = np.sign(step)
        z = towards + (z - towards) * np.exp(-abs(step) / width)
        expected[row] = -size * z
    assert extra == pytest.approx(expected, abs=0.02 * size)
    # Over whole periods dry friction takes about its size times the way.
    work = np.sum(extra * np.diff(x, axis=0))
    assert -size * abs(np.diff(x, axis=0)).sum() < work < -0.6 * size * abs(np.diff(x, axis=0)).sum()


def test_the_reflex_answers_what_was_so_long_ago(parameters):
    delay = 0.0503  # not a whole number of ticks
    extras = LoadExtras(late_k=30.0, late_b=2.0, delay_s=delay)
    _, x, extra = led(parameters, SPRING, extras)
    t = np.arange(len(x)) * 125e-6
    v = np.gradient(x, 125e-6, axis=0)
    middle = t[:-1] + 62.5e-6 - delay
    law = -np.stack(
        [
            30.0 * (np.interp(middle, t, x[:, k]) - X0[k]) + 2.0 * np.interp(middle, t, v[:, k])
            for k in (0, 1)
        ],
        axis=1,
    )
    after = middle > 0.01
    assert extra[after] == pytest.approx(law[after], abs=2e-3)
    assert abs(extra[middle < -0.001]).max() < 1e-5


def test_a_drifting_equilibrium_and_a_push_are_forces_of_the_load(parameters):
    inputs = np.zeros((2000, 6))
    inputs[1000:, 2] = 1.5
    inputs[:, 5] = 0.002
    extras = LoadExtras(drift=(1e-3, -2e-3), drift_from=1.0)
    _, _, extra = led(parameters, SPRING, extras, inputs=inputs)
    t = (np.arange(16000) + 0.5) * 125e-6
    shift = np.outer(t - 1.0, [1e-3, -2e-3])
    shift[:, 1] += 0.002
    law = shift @ K.T
    law[t > 1.0, 0] += 1.5
    assert extra == pytest.approx(law, abs=1e-3)


def test_a_hardening_spring_keeps_the_energy(frictionless):
    """Kinetic and linear energy by the plant, the cubic part by its potential."""
    effects = PlantEffects(load=LoadExtras(cubic=(3e5, 1e5), cubic_radial=2e5))
    p = replace(frictionless, load=SPRING, effects=effects)
    q0 = joint_angles(X0, p.link_lengths_m)

    def cubic(q):
        d = position(q, p.link_lengths_m) - X0
        return 0.25 * (3e5 * d[0] ** 4 + 1e5 * d[1] ** 4 + 2e5 * (d @ d) ** 2)

    plant = Plant(p, q0)
    plant.set_speed(np.array([1.0, -0.7]))
    before, largest = plant.energy(), 0.0
    for _ in range(100):
        motion = plant.run(np.zeros((37, 4)))
        largest = max(largest, cubic(motion.q[-1]))
        assert plant.energy() + cubic(motion.q[-1]) == pytest.approx(before, rel=1e-6)
    assert largest > 0.03 * before


@pytest.mark.parametrize(
    ("course", "law"),
    [
        (RAMP, lambda t: (t - 1.0) / 2.0),
        (JUMP, lambda t: np.where(t < 1.0, -0.5, 0.5)),
        (SINE, lambda t: np.sin(2.0 * np.pi * (t - 1.0) / 0.7 + 0.4)),
    ],
)
def test_a_load_that_changes_has_at_each_instant_the_force_of_its_matrices(parameters, course, law):
    more = {"M": np.diag([0.2, 0.1]), "B": np.array([[3.0, 1.0], [1.0, 2.0]]), "K": np.diag([90.0, -40.0])}
    extras = LoadExtras(
        course=course,
        course_from=1.0,
        course_span=0.7 if course == SINE else 2.0,
        course_phase=0.4,
        more_M=tuple(more["M"].ravel()),
        more_B=tuple(more["B"].ravel()),
        more_K=tuple(more["K"].ravel()),
    )
    motion, x, extra = led(parameters, SPRING, extras)
    t = (np.arange(len(extra)) + 0.5) * 125e-6
    v = np.diff(x, axis=0) / 125e-6
    now = motion.acceleration @ more["M"].T + v @ more["B"].T + middles(x) @ more["K"].T
    still = abs(t - 1.0) > 2e-4  # the jump itself
    assert extra[still] == pytest.approx((-law(t)[:, None] * now)[still], abs=3e-3)
    assert abs(extra).max() > 0.5
