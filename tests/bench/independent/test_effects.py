"""Single effects against what a physics book says of them."""

from __future__ import annotations

import numpy as np
import pytest
from independent.chain import delivered, signals
from independent.effects import EVERY
from independent.effects.base import play, slip
from independent.laboratory import draw
from independent.motion import controlled, derivative, moving, reference

NEEDS = frozenset({"force_sensor", "arm", "mass-spring"})
SEED = next(s for s in range(900, 999) if len(draw(s).plans) == 3)
LAB = draw(SEED, NEEDS)
MIDDLE = slice(2000, -2000)


def motion(kind="free"):
    index, plan = next((i, p) for i, p in enumerate(LAB.plans) if p.kind == kind)
    wanted = moving(LAB, plan, index, 10.0, *reference(LAB, plan, index))
    return controlled(wanted, lambda m: delivered(m, ())[0])


@pytest.fixture(scope="module")
def free():
    return motion()


def made(key, amount):
    effect = EVERY[key](np.random.default_rng(3), LAB)
    effect.amount = amount
    return effect


def power(m, effect):
    return (effect.reaction(m, np.zeros_like(m.theta)) * m.omega).sum(1)


def test_gyroscopic_torque_does_no_work(free):
    assert power(free, made("gyroscopic_motor", 0.1)) == pytest.approx(0, abs=1e-12)


def test_rotor_stores_the_energy_of_its_own_speed(free):
    effect = made("coupling_rotor", 0.02)
    n = effect.ratio
    speed = free.omega[:, 0] + n * (free.omega[:, 1] - free.omega[:, 0])
    gained = derivative(0.5 * 0.02 / n**2 * speed[:, None] ** 2)[:, 0]
    assert power(free, effect)[MIDDLE] == pytest.approx(gained[MIDDLE], abs=1e-6 * np.abs(gained).max())


def test_crank_stores_the_energy_of_its_inertia(free):
    effect = made("counterweight_crank", 0.03)
    stored = 0.5 * 0.03 * np.cos(free.theta[:, :1] - effect.phase) * free.omega[:, :1] ** 2
    gained = derivative(stored)[:, 0]
    assert power(free, effect)[MIDDLE] == pytest.approx(gained[MIDDLE], abs=1e-5 * np.abs(gained).max())


def test_cable_stores_the_energy_of_its_stretch(free):
    effect = made("cable", 8.0)
    d = free.x - effect.rest
    gained = derivative(0.5 * 8.0 * ((d @ effect.K) * d).sum(1, keepdims=True))[:, 0]
    assert power(free, effect)[MIDDLE] == pytest.approx(gained[MIDDLE], abs=1e-5 * np.abs(gained).max())


@pytest.mark.parametrize(
    "key",
    [
        "dry_friction", "stribeck_friction", "unequal_friction", "speed_squared_drag", "friction_by_angle",
        "ratchet",
        "tip_damping", "power_law_friction", "coupled_drag", "bearing_sticks", "oil_warms",
    ],
)  # fmt: skip
def test_friction_only_takes_energy(free, key):
    taken = power(free, made(key, 0.1))
    assert taken.min() >= -1e-12
    assert taken.max() > 0


@pytest.mark.parametrize("key", ["presliding", "cable_maxwell_slip", "air_line_memory", "fractional_damping"])
def test_memory_takes_energy_over_a_whole_trial(free, key):
    taken = power(free, made(key, 0.1))
    assert taken.sum() > 0
    assert taken.min() < 0


def test_sensor_beside_the_end_point_feels_that_point(free):
    """Second derivative of x + r turned with θ2, along the sensor's axes."""
    effect = made("sensor_away", 0.05)
    r = effect.amount * effect.arm
    c, s = np.cos(free.theta[:, 1]), np.sin(free.theta[:, 1])
    place = free.x + np.column_stack([c * r[0] - s * r[1], s * r[0] + c * r[1]])
    ins = LAB.instruments
    true = free.turned(ins.mount, ins.mount_angle, derivative(derivative(place)))
    assert signals(free, (effect,)).felt[MIDDLE] == pytest.approx(true[MIDDLE], abs=1e-5)


def test_tilted_table_shows_at_rest_as_weight():
    """A robot that stands still needs Jᵀ of the payload's weight and its links' own; the sensor reads -g."""
    m = motion("mass-spring")
    rest = moving(LAB, m.plan, m.index, m.since, m.t, np.tile(LAB.centre, (m.t.size, 1)))
    effect = made("tilted_table", 0.5)
    g = 0.5 * effect.g
    with_it, without = signals(rest, (effect,)), signals(rest, ())
    weight = rest.robot.to_joints(rest.theta, np.broadcast_to(m.load.M[0, 0] * g, rest.theta.shape))
    needed = rest.robot.hold(rest.theta, g) - weight
    assert with_it.tau - without.tau == pytest.approx(needed, abs=1e-12)
    assert np.linalg.norm(with_it.felt, axis=1) == pytest.approx(0.5, rel=1e-9)


def test_play_and_slip_by_hand():
    there = np.concatenate([np.linspace(0, 1, 401), np.linspace(1, 0, 401)])
    assert play(there, 0.1)[400] == pytest.approx(0.9)
    assert play(there, 0.1)[-1] == pytest.approx(0.1, abs=0.003)  # worked out on every fourth instant
    # Dahl from rest: z = 1 - exp(-x / width) going out
    assert slip(there, 0.5)[400] == pytest.approx(1 - np.exp(-2), abs=0.01)
    assert slip(there, 0.05)[[400, -1]] == pytest.approx([1, -1], abs=1e-3)


@pytest.mark.parametrize("key", sorted(EVERY))
def test_every_effect_acts_and_is_nothing_at_no_amount(key):
    """In the trials where it says it acts, signals differ with it and hardly differ with next to none."""
    effect = made(key, EVERY[key].start)
    trials = [m for m in KIND.values() if effect.acts(m)]
    assert trials
    full, faint = 0.0, 0.0
    declared = {"robot": {"link_lengths_m": list(LAB.robot.lengths)}}
    effect.declare(declared)
    if declared["robot"]["link_lengths_m"] != list(LAB.robot.lengths):
        return
    for m in trials:
        full += apart(m, effect)
    effect.amount = 1e-7 * EVERY[key].start
    for m in trials:
        faint += apart(m, effect)
    assert full > 0
    # a mean over 50 ms bends a signal by w²/24 of its curvature, one over the grid's own step by h²/4: 0.0024
    assert faint < 3e-3 * full


KIND = {kind: motion(kind) for kind in ("free", "mass-spring", "arm")}


def apart(m, effect):
    a, b, inside = signals(m, (effect,)), signals(m, ()), (m.t >= 0) & (m.t <= m.plan.duration)
    pairs = ((a.theta, b.theta), (a.tau, b.tau), (a.felt, b.felt), (a.force, b.force), (a.clock, b.clock))
    return sum(float(np.sqrt(np.mean((p - q)[inside] ** 2))) for p, q in pairs)
