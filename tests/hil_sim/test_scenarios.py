"""Scenarios: those that ship can be read, and a mistake is one line with file, key and remedy."""

import subprocess
import sys

import pytest

from hil_sim.errors import SimError
from hil_sim.scenarios.load import load, names, trial
from hil_sim.trials import trial_truth
from hil_sim.truth import scenario_json


@pytest.mark.parametrize("name", names())
def test_every_shipped_scenario_can_be_simulated(name):
    scenario = load(name)
    for one in scenario.trials:
        assert trial_truth(scenario, one, 1).name == one.name


def test_first_light_has_the_trials_that_the_demonstration_needs():
    found = {one.name: one.duration_s for one in load("first-light").trials}
    assert found == {"free_01": 50.0, "free_02": 50.0, "spring_K1_M1_01": 50.0, "spring_K5_M3_01": 50.0}


def _set(path, value):
    def change(content):
        *way, last = path
        for key in way:
            content = content[key]
        if value is None:
            del content[last]
        else:
            content[last] = value

    return change


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (_set(["setup", "robot", "link_length_m"], [0.1, 0.1]), r"setup\.robot\.link_length_m: .*spelling"),
        (_set(["setup", "accelerometer", "vref_V"], None), r"setup\.accelerometer\.vref_V: .*add the key"),
        (_set(["setup", "accelerometer", "vref_V"], -3.3), r"vref_V: .*greater than 0"),
        (_set(["world", "robot", "alpha"], [0.01, 0.1, 0.01, 0, 0]), r"world\.robot: .*alpha2"),
        (_set(["trials", 2, "load"], "spring_K9"), r"spring_K9.*\[world\.loads\.spring_K9\]"),
        (_set(["trials", 0, "load"], "spring_K1_M1"), r"trials\.1: .*remove load"),
        (_set(["trials", 1, "name"], "free_01"), r"two trials are called free_01"),
        (_set(["trials", 0, "name"], "../free"), r"trials\.1\.name"),
        (_set(["world", "loads", "spring_K1_M1", "M_kg"], [[-1.0, 0.0], [0.0, 1.0]]), r"spring_K1_M1: M_kg"),
        (_set(["world", "clocks", "board_ppm"], "fast"), r"world\.clocks\.board_ppm: .*number"),
    ],
)
def test_a_mistake_is_one_line_that_names_file_and_key(scenario_file, change, says):
    path = scenario_file(3.0, change)
    with pytest.raises(SimError, match=says) as caught:
        load(str(path))
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message


def _hide(**effect):
    def change(content):
        content["effects"] = [effect]

    return change


@pytest.mark.parametrize(
    ("effect", "says"),
    [
        (
            {"effect": "friction.columb", "torque": 0.1},
            r"friction\.columb: not known; use one of friction\.c",
        ),
        ({"effect": "friction.coulomb"}, r"torque \(N\*m\) is missing; add it"),
        ({"effect": "friction.coulomb", "torqe": 0.1}, r"has no parameter torqe; use torque"),
        ({"effect": "friction.coulomb", "torque": "much"}, r"torque says much; give a number"),
        (
            {"effect": "friction.coulomb", "where": "tip", "torque": 0.1},
            r"cannot be at tip; where may be joint1",
        ),
        (
            {"effect": "friction.coulomb", "torque": 0.1, "trials": ["free_09"]},
            r"free_09: there is no such trial",
        ),
    ],
)
def test_a_mistaken_effect_is_one_line_that_names_the_file(scenario_file, effect, says):
    path = scenario_file(3.0, _hide(**effect))
    with pytest.raises(SimError, match=says) as caught:
        load(str(path))
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_an_effect_too_large_for_the_robot_is_refused(scenario_file):
    heavy = {"effect": "elastic.transmission", "where": "joint1", "stiffness": 100.0, "motor_inertia": 0.2}
    scenario = load(str(scenario_file(3.0, _hide(**heavy))))
    with pytest.raises(SimError, match=r"elastic\.transmission: leaves a link without inertia"):
        trial_truth(scenario, scenario.trials[0], 1)


def test_the_truth_states_effects_their_trials_and_the_noise_floor(scenario_file):
    push = {"effect": "load.hysteresis", "amplitude": 0.5, "width": 0.002}
    scenario = load(str(scenario_file(3.0, _hide(**push))))
    truth = scenario_json(scenario, 1, {}, scenario.trials)
    (hidden,) = truth["effects"]
    assert (hidden["effect"], hidden["where"]) == ("load.hysteresis", ["load"])
    assert hidden["parameters"]["amplitude"] == {"value": 0.5, "unit": "N"}
    assert hidden["trials"] == ["spring_K1_M1_01", "spring_K5_M3_01"]
    assert truth["trials"]["free_01"]["effects"] == []
    # 0.05 N m of white noise and 0.012 of slow.
    assert truth["noise_floor"]["torque_rms_Nm"] == pytest.approx([0.05142, 0.05142], abs=1e-5)


def test_repeated_trials_have_numbers_and_clocks_of_their_own(scenario_file):
    def change(content):
        content["trials"][0] |= {"name": "free_again", "repeat": 3}

    scenario = load(str(scenario_file(3.0, change)))
    made = [one for one in scenario.trials if one.name.startswith("free_again")]
    assert [one.name for one in made] == ["free_again_01", "free_again_02", "free_again_03"]
    assert len({one.robot_zero_s for one in made}) == 3


def test_broken_toml_names_the_line(tmp_path):
    path = tmp_path / "broken.toml"
    path.write_text("format = \n")
    with pytest.raises(SimError, match=r"broken\.toml: not valid TOML.*line 1"):
        load(str(path))


def test_an_unknown_scenario_lists_those_that_there_are():
    with pytest.raises(SimError, match=r"second-light: no such scenario.*first-light"):
        load("second-light")


def test_an_unknown_trial_lists_those_that_there_are():
    with pytest.raises(SimError, match=r"free_99.*free_01, free_02"):
        trial(load("first-light"), "free_99")


def test_a_load_out_of_reach_names_trial_and_load(scenario_file):
    scenario = load(str(scenario_file(3.0, _set(["world", "loads", "spring_K1_M1", "x0_m"], [0.6, 0.0]))))
    with pytest.raises(SimError, match=r"spring_K1_M1_01: .*out of reach.*x0_m of load spring_K1_M1"):
        trial_truth(scenario, trial(scenario, "spring_K1_M1_01"), 1)


def test_the_command_line_prints_one_line_and_fails():
    result = subprocess.run(
        [sys.executable, "-c", "from hil_sim.cli import main; main()", "study", "nowhere.toml", "--out", "x"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 1
    assert result.stdout == ""
    assert result.stderr.count("\n") == 1
    assert result.stderr.startswith("impid-sim: nowhere.toml: no such scenario")
