"""A study of the second simulator, read back from its files by a script of its own."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest
from independent.chain import delivered
from independent.effects import EVERY, NAMED, NAMED2, UNNAMED, UNNAMED2
from independent.folder import write
from independent.laboratory import draw
from independent.study import make
from scipy.signal import butter, sosfiltfilt

G = 9.80665
SHORT = next(s for s in range(900, 999) if len(draw(s).plans) == 3)  # three trials of 15 s


def low(values, rate, cutoff=4.5):
    return sosfiltfilt(butter(5, cutoff, fs=rate, output="sos"), values, axis=0)


class Analyst:
    """A reader that knows the study format and a textbook; clocks are matched by the angles' own shift."""

    def __init__(self, folder):
        self.setup = tomllib.loads((folder / "setup.toml").read_text())
        self.trials = {p.parent.name: p.parent for p in sorted(folder.glob("*/trial.toml"))}

    def read(self, name):
        """On 100 Hz: angles, tip, acceleration (base frame), torque, all low-passed."""
        device = np.genfromtxt(self.trials[name] / "device.csv", delimiter=",", names=True)
        robot = np.genfromtxt(self.trials[name] / "robot.csv", delimiter=",", names=True)
        enc, acc = self.setup["encoder"], self.setup["accelerometer"]
        turn = np.array(enc["direction"]) * 2 * np.pi / np.array(enc["counts_per_rev"])
        theta = np.column_stack([device["enc1"], device["enc2"]]) * turn + enc["zero_rad"]
        volts = np.column_stack([device["ax"], device["ay"]]) / acc["full_scale_code"] * acc["vref_V"]
        felt = (volts - acc["zero_g_V"]) / acc["sensitivity_V_per_g"] * G
        t = (device["t_us"] - device["t_us"][0]) * 1e-6
        own = robot["t"] - robot["t"][0]
        shift, rate = self.match(t, theta, own, np.column_stack([robot["theta1"], robot["theta2"]]))
        grid = np.arange(0.1, min(t[-1], own[-1]) - 0.1, 0.001)
        tau = [np.interp(grid, shift + rate * own, robot[c]) for c in ("tau1", "tau2")]
        parts = [np.interp(grid, t, c) for c in (*theta.T, *felt.T)] + tau
        return low(np.column_stack(parts), 1000.0)[::10]

    @staticmethod
    def match(t, theta, own, theirs):
        """Offset and rate that bring the robot's angles onto the module's (Gauss-Newton)."""
        offset, rate = 0.0, 1.0
        for _ in range(4):
            when = offset + rate * own
            there = np.column_stack([np.interp(when, t, c) for c in theta.T])
            slope = np.column_stack(
                [np.interp(when, t, np.gradient(c, t)) for c in low(theta, 1 / (t[1] - t[0])).T]
            )
            step = np.linalg.lstsq(
                np.column_stack([slope.ravel(), (slope * own[:, None]).ravel()]), (theirs - there).ravel()
            )[0]
            offset, rate = offset + step[0], rate + step[1]
        return offset, rate

    def free_columns(self, name):
        data = self.read(name)
        theta, felt, tau = data[:, :2], data[:, 2:4], data[:, 4:]
        l1, l2 = self.setup["robot"]["link_lengths_m"]
        omega = np.gradient(theta, 0.01, axis=0, edge_order=2)
        acc = self.setup["accelerometer"]
        way = acc["mount_angle_rad"] + (theta[:, 1] if acc["mount"] == "link2" else 0)
        x2 = np.cos(way) * felt[:, 0] - np.sin(way) * felt[:, 1]
        y2 = np.sin(way) * felt[:, 0] + np.cos(way) * felt[:, 1]
        one, two = theta.T
        x2 = x2 + l1 * np.cos(one) * omega[:, 0] ** 2 + l2 * np.sin(two) * omega[:, 1] ** 2
        y2 = y2 + l1 * np.sin(one) * omega[:, 0] ** 2 - l2 * np.cos(two) * omega[:, 1] ** 2
        # J^-1 with J = [[-l1 s1, l2 c2], [l1 c1, l2 s2]], whose determinant is -l1 l2 cos(one - two)
        det = -l1 * l2 * np.cos(one - two)
        a1 = (l2 * np.sin(two) * x2 - l2 * np.cos(two) * y2) / det
        a2 = (-l1 * np.cos(one) * x2 - l1 * np.sin(one) * y2) / det
        s, c = np.sin(one - two) / 2, np.cos(one - two) / 2
        zero = np.zeros_like(a1)
        first = [a1, -s * a2 + c * omega[:, 1] ** 2, zero, omega[:, 0], zero]
        second = [zero, -s * a1 - c * omega[:, 0] ** 2, a2, zero, omega[:, 1]]
        return np.stack([np.column_stack(first), np.column_stack(second)], 1), tau


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    seed = next(s for s in range(30, 300) if plain(draw(s)))
    study = make(seed, [])
    return study, write(study, tmp_path_factory.mktemp("clean"))


def plain(lab):
    """A laboratory for the analyst above: ordinary noise, codes, a fair rate, several free trials."""
    ins = lab.instruments
    free = sum(p.kind == "free" for p in lab.plans)
    return (
        not ins.ready_made
        and ins.torque.kind == "white"
        and ins.robot_rate >= 250
        and free >= 2
        and (
            lab.plans[0].style == "multisine"
            and ins.jitter == 0
            and len(lab.plans) < 9
            and ins.full_scale_code > 5000
        )
    )


def test_free_trials_obey_the_equations_of_motion(clean):
    """Least squares on a clean study finds alpha, and leaves the noise that the truth states, no more."""
    study, folder = clean
    analyst = Analyst(folder)
    columns, tau = zip(
        *(analyst.free_columns(n) for n in analyst.trials if n.startswith("free")), strict=True
    )
    A, y = np.concatenate(columns)[50:-50], np.concatenate(tau)[50:-50]
    alpha, *_ = np.linalg.lstsq(A.reshape(-1, 5), y.ravel())
    assert alpha[:3] == pytest.approx(study.truth["alpha"][:3], rel=0.02)
    assert alpha[3:] == pytest.approx(study.truth["alpha"][3:], rel=0.05)
    left = np.sqrt(np.mean((y - A @ alpha) ** 2, axis=0))
    for joint in range(2):
        # filtering before multiplying costs a little; the analyst here is a plain one
        assert 0.8 < left[joint] / study.truth["noise_rms_4.5Hz"][f"tau{joint + 1}"] < 1.3


def test_counts_read_back_as_the_angles(clean):
    study, folder = clean
    enc = study.setup["encoder"]
    for m in study.motions[:2]:
        rows = np.genfromtxt(folder / m.plan.folder / "device.csv", delimiter=",", names=True)
        t = (
            (rows["t_us"] - round(m.since * 1e6))
            * 1e-6
            / (1 + study.laboratory.instruments.module_ppm * 1e-6)
        )
        for joint in range(2):
            step = enc["direction"][joint] * 2 * np.pi / enc["counts_per_rev"][joint]
            angle = enc["zero_rad"][joint] + step * rows[f"enc{joint + 1}"]
            true = np.interp(t, m.t, m.theta[:, joint])
            assert np.abs(angle - true).max() < 0.51 * abs(step) + 5e-6


def test_clocks_differ_by_a_constant_rate(clean):
    study, folder = clean
    ins, analyst = study.laboratory.instruments, Analyst(folder)
    m = study.motions[0]
    device, robot = (
        np.genfromtxt(folder / m.plan.folder / f"{n}.csv", delimiter=",", names=True)
        for n in ("device", "robot")
    )
    turn = (
        np.array(study.setup["encoder"]["direction"]) * 2 * np.pi / study.setup["encoder"]["counts_per_rev"]
    )
    theta = np.column_stack([device["enc1"], device["enc2"]]) * turn + study.setup["encoder"]["zero_rad"]
    t, own = (device["t_us"] - device["t_us"][0]) * 1e-6, robot["t"] - robot["t"][0]
    _, rate = analyst.match(t, theta, own, np.column_stack([robot["theta1"], robot["theta2"]]))
    assert (rate - 1) * 1e6 == pytest.approx(ins.module_ppm - ins.robot_ppm, abs=15)


def test_the_same_seed_writes_the_same_study():
    first, second = (make(SHORT, [("dry_friction", 3.0)]) for _ in range(2))
    assert np.array_equal(first.records[0].robot["tau1"], second.records[0].robot["tau1"])
    assert first.truth == second.truth


@pytest.mark.parametrize(
    "key", ["dry_friction", "cable", "sensor_turned", "force_gain", "tremor", "table_wobbles"]
)
def test_effects_come_at_the_wanted_strength(key):
    seen = make(SHORT, [(key, 5.0)]).truth["effects"][0]
    assert seen["seen_strength"] == pytest.approx(5.0, rel=0.3)
    assert seen["raw_strength"] > 0.9 * seen["seen_strength"]


def test_dry_friction_is_what_with_differs_from_without():
    """With and without on the same motion: the amount, in the direction of motion, wherever it moves."""
    study = make(SHORT, [("dry_friction", 6.0)])
    m, effect = study.motions[0], study.effects[0]
    extra = delivered(m, study.effects)[0] - delivered(m, ())[0]
    moving = np.abs(m.omega).min(1) > 0.05
    assert extra[moving] == pytest.approx(
        (effect.amount * effect.shares * np.sign(m.omega))[moving], rel=1e-6
    )


def test_as_many_effects_as_promised():
    assert len(NAMED) >= 30
    assert len(UNNAMED) >= 30
    assert len({k.name for k in NAMED.values()}) >= 30
    assert len(NAMED2) >= 30
    assert len(UNNAMED2) >= 50
    assert all(kind.name is None for kind in (*UNNAMED.values(), *UNNAMED2.values()))
    assert all(kind.name for kind in NAMED2.values())
    assert len(EVERY) == sum(len(book) for book in (NAMED, UNNAMED, NAMED2, UNNAMED2))


def test_unusual_noises_are_distinct():
    kinds = set()
    for seed in range(150):
        ins = draw(seed, unusual=True).instruments
        kinds.add((ins.torque, ins.accel, ins.sensor, ins.torque_step, ins.periodic_losses))
    assert len(kinds) == 150


def test_force_sensor_reads_the_load_in_its_own_frame(tmp_path):
    """fx, fy turned back by mount and θ2 are the load's force, and the rest is the stated noise."""
    study = make(
        next(
            s
            for s in range(500)
            if (i := draw(s).instruments).force and i.force_frame == "link2" and i.force_angle
        ),
        [],
    )
    folder, ins = write(study, tmp_path), study.laboratory.instruments
    m = next(m for m in study.motions if m.loaded)
    rows = np.genfromtxt(folder / m.plan.folder / "robot.csv", delimiter=",", names=True)
    way = rows["theta2"] + ins.force_angle
    x = np.cos(way) * rows["fx"] - np.sin(way) * rows["fy"]
    y = np.sin(way) * rows["fx"] + np.cos(way) * rows["fy"]
    t = (rows["t"] - rows["t"][0]) / (1 + ins.robot_ppm * 1e-6)
    grid = np.arange(0, t[-1], 0.005)
    true = m.load.force(m.x, m.v, m.a)
    left = [np.interp(grid, t, c) - np.interp(grid, m.t, f) for c, f in zip((x, y), true.T, strict=True)]
    size = np.sqrt(np.mean(low(np.column_stack(left), 200.0) ** 2, axis=0))
    stated = study.truth["noise_rms_4.5Hz"]
    assert size == pytest.approx([stated["sensor_x"], stated["sensor_y"]], rel=0.25)
    assert np.sqrt(np.mean(true**2)) > 20 * size.max()
