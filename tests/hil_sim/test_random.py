"""Random laboratories: the seed decides, effects get the strength asked for, the truth says so."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.stats import t as student_t

from hil_sim.cli import cli
from hil_sim.effects import catalogue
from hil_sim.effects.strength import Clean, by_channel, scaled, strength
from hil_sim.errors import SimError
from hil_sim.scenarios.random import SMALL, random_scenario
from hil_sim.sensors.noise import Noise, NoiseTruth
from hil_sim.trials import effects_in, without_effects
from hil_sim.truth import effects_json


def trials(scenario, seed):
    return [Clean.of(without_effects(scenario, trial, seed)) for trial in scenario.trials[:2]]


def test_the_seed_decides_about_the_laboratory():
    one, _ = random_scenario(1, SMALL, (), 1.0)
    assert one == random_scenario(1, SMALL, (), 1.0)[0]
    other, _ = random_scenario(2, SMALL, (), 1.0)
    assert one.world.robot.alpha != other.world.robot.alpha
    assert one.world.loads != other.world.loads
    assert not one.effects


def test_noise_alone_has_strength_one_over_chance():
    """Two runs that differ in their noise alone differ by the root of two of the floor."""
    scenario, _ = random_scenario(3, SMALL, (), 1.0)
    truth = without_effects(scenario, scenario.trials[0], 3)
    first, second = Clean.of(truth), Clean.of(replace(truth, seed=4))
    for name in ("tau1", "tau2"):
        a, b = first.residuals.channel[name], second.residuals.channel[name]
        assert np.std(a - b) / np.std(a) == pytest.approx(np.sqrt(2.0), rel=0.25)


def test_strength_of_a_constant_torque_is_its_size_over_the_floor():
    """No parameter of the robot takes up a constant: an offset of 10 floors has strength 10."""
    scenario, _ = random_scenario(3, SMALL, (), 1.0)
    free = trials(scenario, 3)
    floor = np.sqrt(np.mean([np.var(one.residuals.channel["tau2"]) for one in free]))
    entry = catalogue.entry("actuator.offset", ("joint2",), (), {"torque": 10.0 * float(floor)})
    found = by_channel((entry,), free)
    assert np.mean([one["tau2"] for one in found]) == pytest.approx(10.0, rel=0.15)
    assert max(one["tau1"] for one in found) < 3.0


def test_what_a_refit_takes_up_is_not_seen():
    """Viscous drag is one of the robot's own parameters."""
    scenario, _ = random_scenario(3, SMALL, (), 1.0)
    names = tuple(trial.name for trial in scenario.trials if trial.load is None)
    entry = catalogue.entry("outside.one_trial", ("joint1",), names, {"viscous_factor": 1.5})
    assert strength((entry,), trials(scenario, 3)) < 0.5


def test_scaling_grows_what_departs_from_absence():
    scenario, _ = random_scenario(3, SMALL, (), 1.0)
    truth = without_effects(scenario, scenario.trials[0], 3)
    entry = catalogue.entry("actuator.gain", ("joint1",), (), {"gain": 1.05})
    assert scaled(entry, 3.0, truth).values["gain"] == pytest.approx(1.15)
    entry = catalogue.entry(
        "elastic.transmission", ("joint1",), (), {"stiffness": 30.0, "motor_inertia": 0.01}
    )
    assert scaled(entry, 3.0, truth).values["stiffness"] == pytest.approx(10.0)
    assert scaled(entry, 3.0, truth).values["motor_inertia"] == 0.01


@pytest.mark.parametrize("noise", ["white", "ar", "pink", "speed", "student"])
def test_a_kind_of_noise_alone_leaves_the_laboratory_as_it_is(noise):
    mixed, _ = random_scenario(7, SMALL, (), 1.0)
    alone, _ = random_scenario(7, SMALL, (), 1.0, noise=noise)
    kinds = {source.kind for source in alone.world.torque_log.noise}
    assert kinds == ({"white", "speed"} if noise == "speed" else {noise})
    assert alone.world.loads == mixed.world.loads
    assert alone.world.robot == mixed.world.robot
    floors = [np.std(trials(one, 7)[0].residuals.channel["tau1"]) for one in (alone, mixed)]
    assert 0.1 < floors[0] / floors[1] < 10.0


def test_coarser_encoders_count_fewer_steps_for_the_same_motion():
    fine, coarse = (
        without_effects(random_scenario(7, SMALL, (), 1.0, counts_per_rev=counts)[0], trial, 7)
        for counts in (None, 40_000)
        for trial in random_scenario(7, SMALL, (), 1.0)[0].trials[:1]
    )
    assert (fine.encoder.counts_per_rev, coarse.encoder.counts_per_rev) == ((400_000,) * 2, (40_000,) * 2)
    angles = np.array([[0.1, -0.4], [0.7, 0.9]])
    assert fine.encoder.count(angles) == pytest.approx(10.0 * coarse.encoder.count(angles), abs=10.0)
    assert coarse.plant.counts_per_rev == (40_000, 40_000)


def test_a_robot_may_have_no_force_sensor():
    scenario, _ = random_scenario(7, SMALL, (), 1.0, force_sensor=False)
    assert scenario.world.force_sensor is None
    assert scenario.world.loads == random_scenario(7, SMALL, (), 1.0)[0].world.loads


@pytest.mark.parametrize("label", ["friction.coulomb@joint1", "load.damping@load"])
def test_an_effect_gets_the_strength_asked_for(label):
    scenario, reached = random_scenario(11, SMALL, (label,), 3.0)
    assert reached[label] == pytest.approx(3.0, rel=0.1)
    loaded = next(trial for trial in scenario.trials if trial.load)
    witnesses = [scenario.trials[0], loaded] if label.startswith("friction") else [loaded]
    clean = [Clean.of(without_effects(scenario, trial, 11)) for trial in witnesses]
    assert strength(effects_in(scenario, loaded), clean) == pytest.approx(reached[label], rel=1e-9)


def test_the_command_writes_study_and_truth(tmp_path):
    out, truth_file = tmp_path / "study", tmp_path / "truth.json"
    arguments = ["random", "--seed", "5", "--small", "--effect", "load.damping@load", "--strength", "4"]
    result = CliRunner().invoke(cli, [*arguments, "--out", str(out), "--truth", str(truth_file)])
    assert result.exit_code == 0, result.output
    truth = json.loads(truth_file.read_text())
    assert [one["effect"] for one in truth["effects"]] == ["load.damping"]
    assert truth["effects"][0]["trials"] == ["spring_L1_01", "spring_L1_02"]
    assert truth["strength"]["reached"]["load.damping@load"] == pytest.approx(4.0, rel=0.1)
    assert truth["noise_floor"]["torque_rms_Nm"][0] > 0.01
    assert sorted(path.name for path in out.iterdir()) == [
        "free_01",
        "free_02",
        "setup.toml",
        "spring_L1_01",
        "spring_L1_02",
    ]
    # The laboratory is told nothing of it.
    assert "damping" not in (out / "setup.toml").read_text() + (out / "spring_L1_01/trial.toml").read_text()


@pytest.mark.parametrize(
    ("label", "says"),
    [
        ("friction.coulom@joint1", r"friction\.coulom: not known; use one of friction\.coulomb"),
        ("friction.coulomb@joint3", r"cannot be at joint3; where may be joint1, joint2"),
    ],
)
def test_a_wrong_label_is_one_line(label, says):
    with pytest.raises(SimError, match=says):
        random_scenario(1, SMALL, (label,), 3.0)


def drawn_study(*labels, seed=3, **options):
    return random_scenario(seed, SMALL, labels, 3.0, **options)


def test_a_label_says_when_and_fixes_what_chance_would_decide():
    scenario, reached = drawn_study("force.scale@x:spring_L1_02,gain=1.05", "actuator.offset@joint1:free")
    sensor, offset = scenario.effects
    assert (sensor.values["gain"], sensor.trials, sensor.when) == (1.05, ("spring_L1_02",), "all")
    assert (offset.when, offset.trials) == ("free", ())
    there = {trial.name: [one.effect for one in effects_in(scenario, trial)] for trial in scenario.trials}
    assert there == {
        "free_01": ["actuator.offset"],
        "free_02": ["actuator.offset"],
        "spring_L1_01": [],
        "spring_L1_02": ["force.scale"],
    }
    # A size that is stated is not scaled: that of chance is.
    assert reached["force.scale@x:spring_L1_02,gain=1.05"] != pytest.approx(3.0, rel=0.1)
    assert reached["actuator.offset@joint1:free"] == pytest.approx(3.0, rel=0.1)


def test_what_differs_from_trial_to_trial_does_and_the_truth_says_so(tmp_path):
    scenario, _ = drawn_study("load.drift@load")
    rates = [
        next(iter(effects_in(scenario, trial))).in_trial(trial.name).values["rate"]
        for trial in scenario.trials
        if trial.load
    ]
    assert np.hypot(*rates[0]) == pytest.approx(np.hypot(*rates[1]))
    assert np.dot(rates[0], rates[1]) < 0.99 * np.hypot(*rates[0]) ** 2
    (said,) = effects_json(scenario, scenario.trials)
    assert said["parameters"]["rate"]["per_trial"] == {"spring_L1_01": rates[0], "spring_L1_02": rates[1]}
    assert (said["when"], said["trials"]) == ("all", ["spring_L1_01", "spring_L1_02"])


def test_a_link_is_longer_or_shorter_than_declared_by_what_the_strength_asks():
    scenario, reached = drawn_study("geometry.link_length@joint2")
    assert reached["geometry.link_length@joint2"] == pytest.approx(3.0, rel=0.1)
    assert scenario.setup.robot.link_lengths_m == (0.254, 0.2667)
    assert 1e-4 < abs(scenario.effects[0].values["length_m"] - 0.2667) < 5e-3


def test_weighed_payloads_stand_in_the_trials_and_steps_in_the_log():
    scenario, _ = random_scenario(3, SMALL, (), 1.0, weighed=True, torque_quantum_Nm=0.02)
    masses = {trial.payload_kg for trial in scenario.trials if trial.load}
    assert masses == {scenario.world.loads["spring_L1"].M_kg[0][0]}
    assert {trial.payload_kg for trial in scenario.trials if not trial.load} == {None}
    assert scenario.world.torque_log.quantum_Nm == (0.02, 0.02)


def test_heavy_tailed_noise_has_the_spread_it_says_and_more_outliers():
    noise = Noise(NoiseTruth("student", (0.5, 2.0)), 1000.0, np.random.default_rng(5))
    values = noise.add_to(np.zeros((400_000, 2)))
    quartile = student_t(3).ppf(0.75) / np.sqrt(3.0)
    assert np.quantile(values, 0.75, axis=0) == pytest.approx([0.5 * quartile, 2.0 * quartile], rel=0.02)
    beyond = np.mean(abs(values) > 4.0 * np.array([0.5, 2.0]), axis=0)
    assert beyond == pytest.approx(2 * student_t(3).sf(4.0 * np.sqrt(3.0)), rel=0.1)


@pytest.mark.parametrize(
    ("label", "says"),
    [
        ("friction.coulomb@joint1:spring_L9", r"spring_L9 is no trial or load; use free, load or a name"),
        ("friction.coulomb@joint1,torque", r"cannot read torque; write PARAMETER=NUMBER"),
        ("friction.coulomb@joint1,size=3", r"has no parameter size; use torque"),
    ],
)
def test_a_label_that_cannot_be_read_is_one_line(label, says):
    with pytest.raises(SimError, match=says):
        drawn_study(label)


def test_a_force_sensor_that_errs_must_be_there():
    with pytest.raises(SimError, match=r"force\.scale: this laboratory has no force sensor"):
        drawn_study("force.scale@sensor", force_sensor=False)
