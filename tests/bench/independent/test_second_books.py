"""The second books' effects against what a physics book says, the harmless kinds against their truth."""

from __future__ import annotations

import numpy as np
import pytest
from independent.chain import delivered, signals
from independent.effects import EVERY, NAMED2
from independent.folder import write
from independent.harmless import HARMLESS
from independent.instruments import mean_over
from independent.laboratory import draw
from independent.motion import controlled, derivative, low_pass, moving, reference
from independent.noise import FRESH, UNUSUAL, USUAL
from independent.study import make

NEEDS = frozenset({"force_sensor", "arm", "mass-spring"})
SEED = next(s for s in range(900, 999) if len(draw(s).plans) == 3)
LAB = draw(SEED, NEEDS)
MIDDLE = slice(2000, -2000)


def motion(kind):
    index, plan = next((i, p) for i, p in enumerate(LAB.plans) if p.kind == kind)
    wanted = moving(LAB, plan, index, 10.0, *reference(LAB, plan, index))
    return controlled(wanted, lambda m: delivered(m, ())[0])


TRIALS = {kind: motion(kind) for kind in ("free", "mass-spring", "arm")}
FREE, SPRINGS, ARM = TRIALS.values()


def made(key, amount):
    effect = EVERY[key](np.random.default_rng(3), LAB)
    effect.amount = amount
    return effect


def power(m, effect):
    return (effect.reaction(m, delivered(m, ())[0]) * m.omega).sum(1)


def magnet(e, m):
    """∫ k r (1 + r²/h²)^-5/2 dr = -k h²/3 (1 + r²/h²)^-3/2."""
    r2 = ((m.x - e.at) ** 2).sum(1)
    return -e.way * e.amount * e.depth**2 / 3 * (1 + r2 / e.depth**2) ** -1.5


def string(e, m):
    return 0.5 * e.amount * np.clip(np.linalg.norm(m.x - e.hook, axis=1) - e.slack, 0, None) ** 2


def counterbalance(e, m):
    """Both ends' places in the plane, and half the stiffness times the square of what lies between."""
    joint = int(np.flatnonzero(e.mask)[0])
    angle = m.theta[:, joint] - LAB.centre[joint] - e.turned
    end = e.crank * np.column_stack([np.cos(angle), np.sin(angle)])
    return 0.5 * e.amount * (np.linalg.norm(end - [e.post, 0], axis=1) - e.free_length) ** 2


def stop(e, m):
    way_in = np.clip(e.side * (m.theta - e.at), 0, None)
    return (e.mask * e.amount * way_in**2.5 / 2.5).sum(1)


def loom(e, m):
    between = m.theta[:, 0] - m.theta[:, 1] - e.rest
    return e.amount * 0.2 / 4 * (between / 0.2) ** 4


@pytest.mark.parametrize(
    ("key", "amount", "stored", "share"),
    [
        ("table_magnet", 30.0, magnet, 1e-4),
        ("taut_string", 50.0, string, 0.02),  # the pull sets in with a kink
        ("counterbalance_spring", 60.0, counterbalance, 1e-4),
        ("soft_stop", 4.0, stop, 0.01),
        ("loom_stiffens", 0.1, loom, 1e-3),
    ],
)
def test_springs_store_what_they_take(key, amount, stored, share):
    effect = made(key, amount)
    gained = derivative(stored(effect, FREE)[:, None])[:, 0]
    assert np.abs(gained).max() > 0
    assert power(FREE, effect)[MIDDLE] == pytest.approx(gained[MIDDLE], abs=share * np.abs(gained).max())


@pytest.mark.parametrize(
    "key",
    [
        "ageing_contact", "lagging_stribeck", "bearing_side_load", "brake_patch", "eddy_brake",
        "governor_shoes",
        "seal_in_free_trials", "friction_by_trial", "viscosity_by_angle", "unequal_slopes", "steep_stribeck",
        "damped_along_one_line",
    ],
)  # fmt: skip
def test_friction_only_takes_energy(key):
    taken = power(FREE, made(key, 0.1))
    assert taken.min() >= -1e-12
    assert taken.max() > 0


@pytest.mark.parametrize("key", ["dragged_ring", "maxwell_slip_in_joint"])
def test_memory_gives_some_back_and_takes_more(key):
    taken = power(FREE, made(key, 0.1))
    assert taken.sum() > 0
    assert taken.min() < 0


def test_dragged_ring_is_a_ring():
    """With the ring's own speed ω_r, J dω_r/dt = c (ω - ω_r), J = c T."""
    effect = made("dragged_ring", 0.2)
    torque = effect.reaction(FREE, np.zeros_like(FREE.theta))
    joint = int(np.flatnonzero(effect.mask)[0])
    c = effect.amount * effect.shares[joint]
    ring = FREE.omega[:, joint] - torque[:, joint] / c
    inertia = c * effect.lag
    turned = inertia * derivative(ring[:, None])[:, 0]
    assert turned[MIDDLE] == pytest.approx(torque[MIDDLE, joint], abs=0.01 * np.abs(torque).max())


def test_spinning_payload_does_no_work():
    force = made("spinning_payload", 2.0).load_force(SPRINGS, np.zeros_like(SPRINGS.x))
    assert (force * SPRINGS.v).sum(1) == pytest.approx(0, abs=1e-12)
    assert np.linalg.norm(force, axis=1) == pytest.approx(2 * np.linalg.norm(SPRINGS.v, axis=1))


def test_padded_edge_only_pushes_and_takes_energy():
    effect = made("touches_edge", 300.0)
    effect.edge = 0.0
    force = effect.load_force(SPRINGS, np.zeros_like(SPRINGS.x))
    along = force @ effect.way
    assert along.max() <= 0
    assert along.min() < 0
    assert (force * SPRINGS.v).sum() < 0


def test_bent_link_moves_load_and_sensor_to_where_the_tip_is():
    """The load's force and the specific force are those of the place x + d."""
    effect = made("link_bends", 1e-3)
    d = effect.bent(SPRINGS)
    v, a = derivative(d), derivative(derivative(d))
    there = SPRINGS.load.force(SPRINGS.x + d, SPRINGS.v + v, SPRINGS.a + a)
    got = signals(SPRINGS, (effect,))
    ins = LAB.instruments
    sensed = SPRINGS.turned(ins.force_frame, ins.force_angle, there)
    assert got.force[MIDDLE] == pytest.approx(sensed[MIDDLE], abs=1e-9)
    felt = SPRINGS.turned(ins.mount, ins.mount_angle, SPRINGS.a + a)
    assert got.felt[MIDDLE] == pytest.approx(felt[MIDDLE], abs=1e-9)
    link = SPRINGS.theta[:, effect.which]
    axis = np.column_stack(
        [np.cos(link), np.sin(link)] if effect.which == 0 else [np.sin(link), -np.cos(link)]
    )
    assert (d * axis).sum(1) == pytest.approx(0, abs=1e-12)  # sideways only


def test_late_angles_are_those_of_a_moment_ago():
    effect = made("angles_late", 0.02)
    assert signals(FREE, (effect,)).theta[100:] == pytest.approx(FREE.theta[80:-20], abs=1e-12)
    assert np.array_equal(signals(FREE, (effect,)).tau, signals(FREE, ()).tau)


@pytest.mark.parametrize("amount", [0.005, 0.06])
def test_resynced_clock_never_runs_backwards(amount):
    effect = made("clock_resyncs", amount)
    rate = 1 + np.diff(effect.clock(FREE, FREE.t)) * 1000
    assert rate.min() > 0.5
    assert np.ptp(effect.clock(FREE, FREE.t)) == pytest.approx(amount, rel=0.15)


def test_heartbeat_pushes_as_often_as_a_heart():
    effect = made("heartbeat", 1.0)
    push = effect.load_force(ARM, np.zeros_like(ARM.x)) @ effect.way
    beats = np.sum((push[1:] > 0.5) & (push[:-1] <= 0.5)) / (ARM.t[-1] - ARM.t[0])
    assert beats == pytest.approx(effect.rate, rel=0.15)


@pytest.mark.parametrize("key", sorted(NAMED2))
def test_named_effects_act_in_their_trials_only(key):
    """Signals of a trial in which the effect does not act are those of a study without it."""
    effect = made(key, NAMED2[key].start)
    acting = {kind for kind, m in TRIALS.items() if effect.acts(m)}
    assert acting
    expected = {"free": {"free"}, "load": {"mass-spring", "arm"}}.get(effect.when)
    if expected and not getattr(effect, "only", None) and effect.name != "force.scale":
        assert acting <= expected
    for kind in set(TRIALS) - acting:
        got, plain = signals(TRIALS[kind], (effect,)), signals(TRIALS[kind], ())
        assert np.array_equal(got.tau, plain.tau)
        assert np.array_equal(got.felt, plain.felt)
        assert np.array_equal(got.theta, plain.theta)


@pytest.mark.parametrize(
    "key", ["eddy_brake", "soft_stop", "poles_uneven", "log_on_change", "heartbeat", "one_torque_late"]
)
def test_effects_come_at_the_wanted_strength(key):
    seen = make(SEED, [(key, 5.0)]).truth["effects"][0]
    assert seen["seen_strength"] == pytest.approx(5.0, rel=0.3)


@pytest.mark.parametrize("kind", sorted(FRESH))
@pytest.mark.parametrize("rate", [100.0, 1000.0])
def test_fresh_noise_has_unit_size_no_mean_and_two_columns(kind, rate):
    n = int(60 * rate)
    noise = FRESH[kind](np.random.default_rng(8), n, rate)
    assert noise.shape == (n, 2)
    assert np.sqrt(np.mean(noise**2, axis=0)) == pytest.approx(1, rel=0.25)
    # a mean beyond what 60 s of the slow part's own spread allow would be an offset, not noise
    slow = low_pass(noise, 2.0, rate)
    assert np.all(np.abs(noise.mean(0)) < 0.5 * slow.std(0) + 0.02)
    assert kind not in {**USUAL, **UNUSUAL}


@pytest.fixture(scope="module")
def quirky():
    return {key: make(SEED, [], harmless=key) for key in HARMLESS}


@pytest.mark.parametrize("key", sorted(HARMLESS))
def test_harmless_rows_are_truth_and_stated_noise(quirky, key):
    """Torque and acceleration less the stated noise are the true means at the rows' own true times."""
    study = quirky[key]
    assert study.truth["clean"]
    assert study.truth["harmless"] == key
    for m, r in zip(study.motions, study.records, strict=True):
        rate = study.laboratory.instruments.robot_rate
        tau = np.column_stack([r.robot["tau1"], r.robot["tau2"]])
        true = mean_over(signals(m, ()).tau, m, r.robot_t, 1 / rate)
        assert tau - r.torque_noise == pytest.approx(true, abs=1e-9)
        assert r.robot_t.size == r.robot["t"].size == r.torque_noise.shape[0] == r.force_noise.shape[0]
        assert r.module_t.size == r.device["t_us"].size == r.accel_noise.shape[0]
        # the clock of the log, rounded or not, is the true one to a constant and a rate
        line = np.polyfit(r.robot_t, r.robot["t"], 1)
        assert np.abs(r.robot["t"] - np.polyval(line, r.robot_t)).max() < 6e-4
        assert np.all(np.diff(r.robot["t"]) > 0)
        assert np.all(np.diff(r.device["t_us"]) > 0)
        assert r.device["seq"].max() < 2**32


def test_harmless_logging_does_what_it_says(quirky):
    def robot(key, trial=0):
        return quirky[key].records[trial].robot

    half = robot("half_floats")["tau1"]
    assert np.array_equal(half.astype(np.float16), half)
    assert all(len(f"{abs(v):.3e}".split("e")[0].rstrip("0")) <= 4 for v in robot("three_digits")["tau1"])
    assert np.array_equal(robot("rounded_stamps")["t"], np.round(robot("rounded_stamps")["t"], 3))
    assert len(np.unique(np.diff(robot("rounded_stamps")["t"]).round(4))) > 1
    gaps = np.diff(robot("on_change")["t"])
    assert gaps.max() < 9.5 * gaps.min()
    assert len(np.unique(gaps.round(5))) > 3
    assert np.diff(quirky["burst_losses"].records[0].robot["t"]).max() < 0.1
    record = quirky["late_start"].records[0]
    assert record.robot_t[0] > 0.25
    seqs = np.concatenate([r.device["seq"] for r in quirky["long_uptime"].records])
    assert np.sum(np.diff(seqs) < 0) == 1
    assert quirky["long_uptime"].records[0].device["t_us"][0] > 2**32
    assert np.all(np.mod(quirky["low_bits"].records[0].device["ax"], 16) == 0)


def test_harmless_studies_are_written_like_any_other(quirky, tmp_path):
    folder = write(quirky["long_uptime"], tmp_path)
    first = sorted(folder.glob("*/device.csv"))[0]
    rows = np.genfromtxt(first, delimiter=",", names=True, dtype=float)
    assert rows["t_us"][0] == quirky["long_uptime"].records[0].device["t_us"][0]


def test_a_harmless_kind_keeps_the_laboratory_of_its_seed(quirky):
    """Same robot, loads and motions as without it, so that an alarm can be laid at its door."""
    plain = make(SEED, [])
    for key in ("half_floats", "mains_hum"):
        lab = quirky[key].laboratory
        assert lab.robot == plain.laboratory.robot
        assert np.array_equal(quirky[key].motions[0].theta, plain.motions[0].theta)
