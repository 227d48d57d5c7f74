"""The live force on a simulated trial against the offline one, with what can go wrong on the way."""

from dataclasses import replace

import numpy as np
import pytest
from impid_host.impedance.campaign import Options, fit_study
from impid_host.impedance.force import force_series
from impid_host.impedance.identify import RobotFit
from impid_host.live.observer import BY_ANGLES, WITH_MODULE, LiveForce
from impid_host.live.torques import Rows
from impid_host.live.window import look
from impid_host.samples import rows_of
from impid_host.signals.chain import DEFAULT
from impid_host.study.folder import read_study

from hil_sim.scenarios.load import load
from hil_sim.study.write import write_study

SPRING = np.array([[421.57, -18.87], [-18.87, 213.35]])  # of the scenario
NAMES = ("t_us", "ax", "ay", "enc1", "enc2")


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory):
    """A study, its robot, and one trial with its offline force."""
    folder = tmp_path_factory.mktemp("live") / "study"
    write_study(load("first-light"), folder, seed=4)
    study = read_study(folder)
    fit = fit_study(study, Options())
    assert isinstance(fit.robot, RobotFit)
    robot = fit.robot.parameters
    trial = next(trial for trial in study.trials if trial.name == "spring_K1_M1_01")
    aligned = next(part for part in fit.trials if part.name == trial.name)
    return study, robot, trial, aligned, force_series(aligned, robot, DEFAULT)


def replay(laboratory, *, late_s=0.003, late_until=99.0, block=4, without=(0.0, 0.0), setup=None, until=20.0):
    """What is shown of the first seconds: stamps on the module's clock, forces, with the module or not.

    Args:
        late_s: how long a batch of ten samples is on its way, up to `late_until`; then it is there before the
            rows. without: s between which none comes.
    """
    study, robot, trial, aligned, _ = laboratory
    observer = LiveForce(setup or study.setup, robot, 8.0)
    clock, device, log = aligned.clock, trial.device, trial.robot
    observer.matched(clock, (1, 0))
    stamps, fed, shown = device.t_us * 1e-6, 0, []
    for k in range(0, int(until * 1000), block):
        rows = Rows(log.t[k : k + block], log.theta[k : k + block], log.tau[k : k + block])
        now = float(clock.to_device(rows.t[-1:])[0])
        since = now - stamps[0]
        while stamps[fed + 9] + (late_s if since < late_until else -0.02) <= now:
            if not without[0] < since < without[1]:
                part = slice(fed, fed + 10)
                piece = {"boot_id": 1, "run": 0, "flags": 0, "index": range(fed, fed + 10)}
                observer.module.take(piece | {name: getattr(device, name)[part] for name in NAMES})
            fed += 10
        shown.append(observer.take(rows))
    t = clock.to_device(np.concatenate([part.t for part in shown]))
    return t, np.concatenate([part.force for part in shown]), np.array([part.with_module for part in shown])


def relative(laboratory, t, force, since=0.0):
    """rms of the difference from the offline force, of its own about its mean, per axis."""
    _, _, _, aligned, offline = laboratory
    inside = offline.valid & (aligned.t > t[0] + since) & (aligned.t < t[-1])
    own = np.stack([np.interp(aligned.t[inside], t, axis) for axis in force.T], axis=1)
    error = np.sqrt(np.mean((own - offline.virtual[inside]) ** 2, axis=0))
    return error / offline.virtual[inside].std(axis=0)


def test_it_is_within_a_tenth_of_the_offline_force(laboratory) -> None:
    t, force, by_module = replay(laboratory)
    assert by_module[50:].all()
    assert (relative(laboratory, t, force) < 0.1).all()
    # Not even the observer's own lag, which the stamps take off, would bring it there.
    assert (relative(laboratory, t + 1 / WITH_MODULE.gain, force) < 0.1).all()
    # A constant stiffness of the wrong size would not pass: the scale of the force is right.
    assert (relative(laboratory, t, 1.15 * force) > 0.1).all()


def test_by_angles_alone_it_is_too_with_good_encoders(laboratory) -> None:
    study, *_ = laboratory
    t, force, by_module = replay(laboratory, setup=replace(study.setup, accelerometer=None))
    assert not by_module.any()
    assert (relative(laboratory, t, force) < 0.1).all()


def test_it_goes_on_without_samples_and_comes_back_with_them(laboratory) -> None:
    t, force, by_module = replay(laboratory, without=(8.0, 12.0))
    part = {2.0 * k: by_module[500 * k + 100 : 500 * k + 400].mean() for k in range(10)}
    assert part[4.0] == part[6.0] == part[14.0] == 1.0
    assert part[8.0] == part[10.0] == 0.0
    assert (relative(laboratory, t, force) < 0.1).all()
    assert BY_ANGLES.gain < WITH_MODULE.gain


def test_samples_that_come_late_cost_little_and_leave_nothing_behind(laboratory) -> None:
    """Rows are shown before their samples have come; once they have, all is as if they had come at once."""
    _, early, _ = replay(laboratory, late_s=-0.02, until=6.0)
    _, late, by_module = replay(laboratory, late_s=0.025, late_until=4.0, until=6.0)
    assert by_module[200:].all()
    size = early.std(axis=0)
    assert (np.sqrt(np.mean((early - late)[200:3900] ** 2, axis=0)) < 0.1 * size).all()
    assert np.abs(early - late)[3000:3900].max() > 0.02
    assert late[4300:] == pytest.approx(early[4300:], abs=2e-3)


def test_the_running_stiffness_holds_the_springs(laboratory) -> None:
    """Six windows that share nothing: of 24 intervals of 95 % at least 20 hold the truth."""
    study, robot, trial, _, _ = laboratory
    inside = 0
    stamps, log = trial.device.t_us * 1e-6, trial.robot
    for k in range(6):
        begin = 8.0 * k
        some = (stamps - stamps[0] >= begin) & (stamps - stamps[0] < begin + 8.0)
        rows = slice(int(1000 * begin), int(1000 * begin) + 8000)
        found = look(
            rows_of(trial.device, some), Rows(log.t[rows], log.theta[rows], log.tau[rows]), study.setup, robot
        )
        assert found.clock is not None
        assert found.load is not None
        K = found.load.K
        assert K.value == pytest.approx(SPRING, abs=8.0)
        low, high = K.ci95[..., 0], K.ci95[..., 1]
        inside += int(((low <= SPRING) & (high >= SPRING)).sum())
    assert inside >= 20


def test_seconds_that_tell_nothing_say_so(laboratory) -> None:
    study, robot, trial, _, _ = laboratory
    device, log = trial.device, trial.robot
    short = look(
        rows_of(device, slice(0, 900)), Rows(log.t[:900], log.theta[:900], log.tau[:900]), study.setup, robot
    )
    assert short.load is None
    assert "at least 2 s are needed" in short.reason
    count = np.full(5000, 7, np.int32)
    held = replace(rows_of(device, slice(0, 5000)), enc1=count, enc2=count)
    still = np.tile(log.theta[:1], (5000, 1))
    rest = look(held, Rows(log.t[:5000], still, log.tau[:5000]), study.setup, robot)
    assert rest.clock is None
    assert "hardly move" in rest.reason
