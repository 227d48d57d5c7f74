"""Force perturbation trials and arms: the log against the load's own equation, the push against [P]."""

import tomllib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import butter, coherence, sosfiltfilt, welch

from hil_sim.errors import SimError
from hil_sim.plant.kinematics import position
from hil_sim.plant.perturbation import random_perturbation
from hil_sim.scenarios.load import SHIPPED, load, trial
from hil_sim.sensors.force_sensor import ForceSensorTruth
from hil_sim.sensors.torque_log import joined
from hil_sim.serve.robot_log import LiveRobotLog
from hil_sim.trials import trial_truth
from hil_sim.world import World


def run(scenario, name, seconds):
    """A trial with silent log and force sensor: its rows and its truth."""
    one = trial(scenario, name).model_copy(update={"duration_s": seconds})
    truth = trial_truth(scenario, one, 4)
    truth = replace(
        truth,
        log=replace(truth.log, noise=(), quantum_Nm=(0.0, 0.0)),
        force_sensor=ForceSensorTruth(noise=()),
    )
    world = World(truth)
    world.begin(0)
    at = 10_000
    while not world.log_complete:
        world.read(at, 1000)
        at += 1_000_000
    return joined(world.take_log()), truth


@pytest.fixture(scope="module")
def shaken():
    return run(load("palazzolo-sa1"), "sa1_01", 20.0)


def test_the_log_of_a_shaken_load_has_500_rows_a_second(shaken):
    rows, _ = shaken
    assert np.diff(rows.t_s) == pytest.approx(2e-3)
    assert rows.t_s.size == 10_000
    assert rows.command_N.std(axis=0) == pytest.approx([4.0, 4.0], rel=0.1)


def test_force_over_motion_is_the_dynamic_stiffness_of_the_array(shaken):
    """-F = K (x - x0) + B x' + M x'' from 0.5 to 12 Hz, in the weak form: derivatives go to the taper w.

    w x' = (w x)' - w' x and w x'' = (w x)'' - 2 (w' x)' + w'' x, exactly. The logged force is a mean over
    2 ms, whose gain a sinc takes off; the angles are instants.
    """
    rows, truth = shaken
    M, B, K = truth.plant.load.M, truth.plant.load.B, truth.plant.load.K
    x = position(rows.theta_rad, truth.plant.link_lengths_m) - truth.plant.load.x0
    n, rate = x.shape[0], 2.0 * np.pi / (x.shape[0] * 2e-3)
    turn = 2.0 * np.pi * np.arange(n)[:, None] / n
    w, w1, w2 = 0.5 - 0.5 * np.cos(turn), 0.5 * rate * np.sin(turn), 0.5 * rate**2 * np.cos(turn)
    f = np.fft.rfftfreq(n, 2e-3)
    iw = 2j * np.pi * f[:, None]
    X, X1, X2 = (np.fft.rfft(taper * x, axis=0) for taper in (w, w1, w2))
    velocity, acceleration = iw * X - X1, iw**2 * X - 2.0 * iw * X1 + X2
    F = np.fft.rfft(w * rows.force_N, axis=0) / np.sinc(f * 2e-3)[:, None]
    expected = -(X @ K.T + velocity @ B.T + acceleration @ M.T)
    use = (f > 0.5) & (f < 12.0)
    assert np.linalg.norm(F[use] - expected[use]) < 1e-3 * np.linalg.norm(F[use])


def test_the_live_log_of_a_shaken_load_has_the_commanded_force(shaken, tmp_path):
    rows, _ = shaken
    log = LiveRobotLog(tmp_path / "robot.csv", with_force=True, with_command=True)
    log.add([rows])
    log.finish()
    table = np.genfromtxt(tmp_path / "robot.csv", delimiter=",", names=True)
    assert table.dtype.names == ("t", "theta1", "theta2", "tau1", "tau2", "fx", "fy", "fdx", "fdy")
    assert table["fdy"] == pytest.approx(rows.command_N[:, 1], abs=1e-5)


def test_the_perturbation_ends_at_15_hz_and_its_axes_are_hardly_coherent():
    made = random_perturbation(
        hold_m=np.array([0.36, 0.0]),
        rms_N=4.0,
        highest_Hz=15.0,
        duration_s=50.0,
        link_lengths_m=(0.254, 0.2667),
        generator=np.random.default_rng(1),
    )
    f, density = welch(made.force_N, fs=500.0, nperseg=2048, axis=0)
    within, beyond = density[(f > 1) & (f < 13)].mean(axis=0), density[(f > 25) & (f < 40)].mean(axis=0)
    assert np.all(beyond < 1e-3 * within)
    assert made.force_N.std(axis=0) == pytest.approx([4.0, 4.0])
    _, shared = coherence(made.force_N[:, 0], made.force_N[:, 1], fs=500.0, nperseg=2048)
    assert shared[f < 15].mean() < 1.2 / 23  # 23 independent segments of noise share one over their number
    held = made.ticked(1e-3)
    assert np.array_equal(held.ticks(0, 4)[:, 2:], np.repeat(made.force_N[:2], 2, axis=0))
    assert not held.ticks(50_000, 3)[:, 2:].any()


def test_the_robot_pushes_with_what_was_commanded(shaken):
    """J'^-1 tau = F + kp (x0 - x) - kd v, [P] eq. 2, from the logged angles alone (v filtered at 20 Hz)."""
    rows, truth = shaken
    l1, l2 = truth.plant.link_lengths_m
    q = rows.theta_rad
    J = np.array(
        [[-l1 * np.sin(q[:, 0]), l2 * np.cos(q[:, 1])], [l1 * np.cos(q[:, 0]), l2 * np.sin(q[:, 1])]]
    ).transpose(2, 0, 1)
    force = np.linalg.solve(np.swapaxes(J, 1, 2), rows.tau_Nm[:, :, None])[:, :, 0]
    x = position(q, (l1, l2))
    v = np.gradient(x, 2e-3, axis=0)
    expected = rows.command_N - 100.0 * (x - truth.plant.load.x0) - 5.0 * v
    low = butter(4, 3.0, fs=500.0, output="sos")
    difference = sosfiltfilt(low, force - expected, axis=0)[500:-500]
    assert difference.std(axis=0).max() < 0.05 * sosfiltfilt(low, expected, axis=0).std(axis=0).min()


def test_the_handle_hangs_on_the_arms_side_of_the_sensor():
    """-F = (M + 0.135) x'' + B x' + K (x - xv), [D] Sec. II-D, from the logged angles."""
    scenario = load("dyck-2013-arm")
    rows, truth = run(scenario, "arm_01", 12.0)
    arm = scenario.world.loads["arm"]
    x = position(rows.theta_rad, truth.plant.link_lengths_m)
    v = np.gradient(x, 1e-3, axis=0)
    a = np.gradient(v, 1e-3, axis=0)
    M = np.array(arm.M_kg) + 0.135 * np.eye(2)
    B, K = np.array(arm.B_Ns_per_m), np.array(arm.K_N_per_m)
    low = butter(4, 5.0, fs=1000.0, output="sos")
    law = sosfiltfilt(low, -(a @ M.T + v @ B.T + (x - arm.x0_m) @ K.T), axis=0)[2000:-2000]
    force = sosfiltfilt(low, rows.force_N, axis=0)[2000:-2000]
    assert np.sqrt(np.mean((force - law) ** 2)) < 2e-3 * force.std()


def test_the_shipped_arrays_are_those_of_the_table():
    table = tomllib.loads((SHIPPED / "spring_arrays.toml").read_text(encoding="utf-8"))
    loads = load("palazzolo-springs").world.loads
    assert set(loads) == {array["name"] for array in table["array"]}
    for array in table["array"]:
        shipped = loads[array["name"]]
        values, axes = np.linalg.eigh(np.array(shipped.K_N_per_m))
        assert values == pytest.approx(sorted([array["k_minor_N_m"], array["k_major_N_m"]]), abs=0.01)
        if values[1] > values[0] + 1.0:
            turn = np.rad2deg(np.arctan2(axes[1, 1], axes[0, 1]))
            assert (turn - array["major_axis_deg"] + 90.0) % 180.0 - 90.0 == pytest.approx(0.0, abs=0.01)
        zeta = np.diag(shipped.B_Ns_per_m) / (2.0 * np.sqrt(0.429 * np.diag(shipped.K_N_per_m)))
        assert zeta == pytest.approx([0.01, 0.01], rel=1e-4)
        assert np.array(shipped.M_kg) == pytest.approx(0.429 * np.eye(2))


def test_the_first_papers_campaign_is_its_table_i():
    scenario = load("dyck-2013-springs")
    loads = scenario.world.loads
    assert len(loads) == 25
    assert sum(one.kind == "free" for one in scenario.trials) == 6
    assert len(scenario.trials) == 6 + 75
    K4M5 = loads["spring_K4_M5"]
    assert K4M5.K_N_per_m == ((190.26, -2.08), (-2.08, 406.39))
    assert K4M5.M_kg == ((1.527, 0.0), (0.0, 1.527))
    assert K4M5.x0_m == (0.39, 0.036)


def test_a_designed_perturbation_is_played_row_by_row(tmp_path):
    force = np.stack([np.sin(0.01 * np.arange(1000)), np.arange(1000) / 500.0], axis=1)
    table = np.column_stack([np.arange(1000) / 500.0, force])
    np.savetxt(tmp_path / "p.csv", table, delimiter=",", header="t,fdx,fdy", comments="", fmt="%.9f")
    text = (SHIPPED / "palazzolo-sa1.toml").read_text()
    (tmp_path / "own.toml").write_text(text.replace("repeat = 2", 'command_csv = "p.csv"'))
    rows, _ = run(load(str(tmp_path / "own.toml")), "sa1", 3.0)
    assert rows.command_N[:1000] == pytest.approx(force, abs=1e-8)
    assert np.all(rows.command_N[1000:] == 0)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("t,fdx\n0,1\n0.002,2\n", "needs the columns"),
        ("t,fdx,fdy\n0,1,1\n0.001,2,2\n", "500 rows a second"),
        ("t,fdx,fdy\n0,1,1\n0.002,x,2\n", "not a number"),
        (None, "cannot be read"),
    ],
)
def test_a_perturbation_that_cannot_be_played_is_named(tmp_path, content, words):
    if content is not None:
        (tmp_path / "p.csv").write_text(content)
    text = (SHIPPED / "palazzolo-sa1.toml").read_text()
    (tmp_path / "own.toml").write_text(text.replace("repeat = 2", 'command_csv = "p.csv"'))
    scenario = load(str(tmp_path / "own.toml"))
    with pytest.raises(SimError, match=words):
        trial_truth(scenario, trial(scenario, "sa1"), 1)


def test_the_paper_s_trials_repeat_one_pair_of_perturbations():
    scenario = load("palazzolo-sa1")
    courses: list[Any] = [trial_truth(scenario, trial(scenario, n), 4).course for n in ("sa1_01", "sa1_02")]
    forces = [course.force_N for course in courses]
    np.testing.assert_array_equal(*forces)
    text = (SHIPPED / "palazzolo-sa1.toml").read_text()
    assert "alike = true" in text
