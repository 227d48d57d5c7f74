"""What stands between command and joint, and between joint and encoder; parts that couple."""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.effects import catalogue
from hil_sim.plant.kinematics import joint_angles, position
from hil_sim.plant.physics import PlantEffects, Slip
from hil_sim.plant.plant import Plant
from hil_sim.scenarios.load import load, trial
from hil_sim.sensors.accelerometer import Bracket, Ringing
from hil_sim.sensors.clock import Clock
from hil_sim.trials import without_effects
from hil_sim.world import World

FROM = np.array([0.9, 0.2])
INERTIA = 0.05


def commanded(parameters, torque, ticks, **effects):
    """Joint 1 alone under a constant command: kd sees no speed, so the torque is kd times the reference's."""
    p = replace(parameters, alpha=(INERTIA, 0.0, INERTIA, 0.0, 0.0), effects=PlantEffects(**effects))
    plant = Plant(replace(p, kp=(0.0, 0.0), kd=(torque, 0.0), velocity_cutoff_Hz=1e-9), FROM)
    reference = np.zeros((ticks, 4))
    reference[:, 2] = 1.0
    return plant.run(reference)


def times(motion):
    return np.arange(1, len(motion.w) + 1) * 125e-6


def test_a_lagging_drive_nears_its_command_exponentially(parameters):
    """I w = T (t - L (1 - exp(-t / L))), while the log holds the command."""
    motion = commanded(parameters, 0.3, 300, lag_s=(0.02, 0.0))
    t = times(motion)
    assert motion.torque[:, 0] == pytest.approx(0.3)
    assert INERTIA * motion.w[:, 0] == pytest.approx(
        0.3 * (t + 0.02 * np.expm1(-t / 0.02)), rel=1e-6, abs=1e-9
    )


def test_a_fading_torque_constant_gives_less_as_the_drive_warms_up(parameters):
    """I w' = T (1 - f (1 - exp(-(t + t0) / s))), integrated."""
    motion = commanded(parameters, 0.3, 2000, fade=(0.2, 0.0), fade_s=0.5, fade_from=0.3)
    t = times(motion)
    lost = t + 0.5 * np.exp(-0.3 / 0.5) * np.expm1(-t / 0.5)
    assert INERTIA * motion.w[:, 0] == pytest.approx(0.3 * (t - 0.2 * lost), rel=1e-6)


def test_an_encoder_on_a_creeping_cable_runs_ahead_with_torque_and_way(parameters):
    """c T q in one direction; the counts show joint and creep together."""
    motion = commanded(parameters, 0.3, 500, creep=(0.05, 0.0))
    turned = motion.q[:, 0] - FROM[0]
    assert motion.crept[:, 0] == pytest.approx(0.05 * 0.3 * turned, rel=1e-6)
    assert not motion.crept[:, 1].any()
    seen = motion.count[1:, 0] * 2.0 * np.pi / 400_000
    assert seen == pytest.approx((motion.q + motion.crept)[7:-1:8, 0], abs=1e-5)


def test_board_and_robot_see_the_same_creep():
    scenario = load("first-light")
    short = trial(scenario, "spring_K1_M1_01").model_copy(update={"duration_s": 3.0})
    entry = catalogue.entry("outside.capstan_creep", ("joint2",), (), {"coefficient": 0.05})
    truth = catalogue.apply(without_effects(scenario, short, 3), (entry,))
    plant = replace(truth.plant, true_tick_s=1e-3)
    truth = replace(truth, plant=plant, robot_clock=Clock(0.0, 0.0), board_rate_ppm=0.0)
    world = World(truth)
    world.begin(1000)
    readings = world.read(1000, 3100)
    theta = np.concatenate([part.theta_rad for part in world.take_log()])
    assert truth.encoder.angle(readings.encoder)[: len(theta)] == pytest.approx(theta, abs=4e-5)


def test_a_geared_rotor_couples_the_links_by_a_constant(frictionless):
    """Energy with J12 w1 w2 in it stays, and both links start under a torque on the first as A says."""
    p = replace(frictionless, effects=PlantEffects(inertia12=-0.012))
    plant = Plant(p, FROM)
    plant.set_speed(np.array([2.0, -3.0]))
    before = plant.energy()
    plain = Plant(frictionless, FROM)
    plain.set_speed(np.array([2.0, -3.0]))
    assert before - plain.energy() == pytest.approx(-0.012 * 2.0 * -3.0)
    plant.run(np.zeros((3000, 4)))
    assert plant.energy() == pytest.approx(before, rel=1e-8)
    pull = np.zeros((1, 6))
    pull[:, 0] = 0.4
    start = Plant(p, FROM).run(np.zeros((1, 4)), pull)
    a1, a2, a3 = frictionless.alpha[:3]
    h = -0.5 * a2 * np.sin(FROM[0] - FROM[1]) - 0.012
    law = np.linalg.solve(np.array([[a1, h], [h, a3]]), [0.4, 0.0])
    assert start.w[0] == pytest.approx(law * 125e-6, rel=1e-4)


def test_the_weight_of_a_link_is_a_potential_of_its_angle(frictionless):
    """-s cos q + c sin q, of each link by itself."""
    p = replace(frictionless, effects=PlantEffects(weight_sin=(0.8, -0.3), weight_cos=(-0.5, 0.4)))
    plant = Plant(p, FROM)
    plant.set_speed(np.array([2.0, -3.0]))
    before = plant.energy()
    q = plant.run(np.zeros((3000, 4))).q[-1]

    def potential(q):
        return float(-np.cos(q) @ [0.8, -0.3] + np.sin(q) @ [-0.5, 0.4])

    assert abs(potential(q) - potential(FROM)) > 0.05
    assert plant.energy() - before == pytest.approx(potential(FROM) - potential(q), abs=2e-6)


def test_a_slipping_cable_pulls_at_the_end_effector_by_masings_rule(parameters):
    """Led to and fro along x: the links' acceleration is due to torque and J' F, F = -pull."""
    slip = Slip.evenly(3.0, 0.01)
    effects = PlantEffects(tip_slip=(slip, Slip()))
    p = replace(
        parameters, alpha=(0.05, 0.0, 0.05, 0.0, 0.0), effects=effects, kp=(400.0,) * 2, kd=(8.0,) * 2
    )
    x0, t = np.array([0.36, 0.0]), np.arange(4000) * 1e-3
    x = x0 + np.outer(0.03 * np.sin(0.5 * np.pi * t) ** 2, [1.0, 0.0])
    q = np.array([joint_angles(place, p.link_lengths_m) for place in x])
    motion = Plant(p, q[0]).run(np.hstack([q, np.gradient(q, 1e-3, axis=0)]))
    w = np.vstack([[0.0, 0.0], motion.w[7::8]])
    at = motion.q[3::8]  # the middle of each tick
    l1, l2 = p.link_lengths_m
    J = np.array([[[-l1 * np.sin(a), l2 * np.cos(b)], [l1 * np.cos(a), l2 * np.sin(b)]] for a, b in at])
    by = 0.05 * np.diff(w, axis=0) / 1e-3 - motion.torque
    pull = -np.linalg.solve(np.swapaxes(J, 1, 2), by[:, :, None])[:, :, 0]
    moved = position(at, p.link_lengths_m)[:, 0] - x0[0]

    def first(way):
        return sum(
            level * np.minimum(way / limit, 1.0) for level, limit in zip(slip.level, slip.limit, strict=True)
        )

    there, back, top = slice(50, 950), slice(1100, 1900), moved.max()
    assert pull[there, 0] == pytest.approx(first(moved[there]), abs=0.03)
    assert pull[back, 0] == pytest.approx(first(top) - 2.0 * first(0.5 * (top - moved[back])), abs=0.03)
    assert abs(pull[:, 1]).max() < 0.03


@pytest.mark.parametrize("frequency_Hz", [1.0, 4.0, 9.0])
def test_a_bracket_answers_as_one_mode_of_a_shaken_foot(frequency_Hz):
    bracket = Bracket(share=0.3, frequency_Hz=4.0, damping_ratio=0.05)
    t = np.arange(240_000) * 125e-6
    foot = np.stack([np.sin(2.0 * np.pi * frequency_Hz * t), np.zeros(t.size)], axis=1)
    felt = Ringing(bracket, 125e-6).felt(foot)[120_000:, 0]
    s, omega = 2j * np.pi * frequency_Hz, 2.0 * np.pi * 4.0
    mode = (2 * 0.05 * omega * s + omega**2) / (s**2 + 2 * 0.05 * omega * s + omega**2)
    expected = 1.0 + 0.3 * (mode - 1.0)
    wave = np.exp(2j * np.pi * frequency_Hz * t[120_000:])
    assert 2j * np.mean(felt * np.conj(wave)) == pytest.approx(expected, rel=2e-3)


def test_a_bracket_at_rest_feels_gravity_as_it_always_has():
    ringing = Ringing(Bracket(0.3, 4.0, 0.02), 125e-6)
    ringing.rest(np.array([[0.02, -0.5]]))
    assert ringing.felt(np.tile([[0.02, -0.5]], (1000, 1))) == pytest.approx(np.tile([0.02, -0.5], (1000, 1)))


def test_a_clock_swings_about_its_own_straight_line():
    """No zero and no rate of another clock would fit it better."""
    clock = Clock(0.0, 0.0, swing_s=0.004, swing_period_s=23.0, swing_phase_rad=1.1, span_s=30.0)
    t = np.linspace(0.0, 30.0, 30_001)
    ahead = clock.ahead(t)
    line = np.polyfit(t, ahead, 1)
    assert abs(np.polyval(line, t)).max() < 1e-6
    # It still is that sine but for a line.
    rest = ahead - 0.004 * np.sin(2.0 * np.pi * t / 23.0 + 1.1)
    assert np.diff(rest, 2) == pytest.approx(np.zeros(t.size - 2), abs=1e-12)


def test_an_effect_has_in_each_trial_the_parameters_of_that_trial():
    scenario = load("first-light")
    entry = catalogue.entry(
        "actuator.offset", ("joint1",), (), {"torque": 0.1}, per_trial={"free_02": {"torque": -0.3}}
    )
    offset = {
        name: catalogue.apply(
            without_effects(scenario, trial(scenario, name), 1), (entry,)
        ).plant.effects.offset
        for name in ("free_01", "free_02")
    }
    assert offset == {"free_01": (0.1, 0.0), "free_02": (-0.3, 0.0)}


@pytest.mark.parametrize(
    ("when", "trials", "there"),
    [
        ("free", (), {"free_01"}),
        ("load", (), {"spring_01"}),
        ("all", ("spring",), {"spring_01"}),
        ("all", ("free_01",), {"free_01"}),
        ("all", (), {"free_01", "spring_01"}),
    ],
)
def test_when_an_effect_acts(when, trials, there):
    entry = catalogue.entry("actuator.offset", ("joint1",), trials, {"torque": 0.1}, when=when)
    present = {
        name
        for name, of in (("free_01", None), ("spring_01", "spring"))
        if catalogue.applies(entry, name, loaded=of is not None, load=of)
    }
    assert present == there
