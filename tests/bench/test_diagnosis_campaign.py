"""The campaign that judges diagnoses: its verdicts are those of a reader."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from diagnosis_campaign.accuracy import bias, parameters
from diagnosis_campaign.answer import acts_in, values
from diagnosis_campaign.page import page
from diagnosis_campaign.tally import rate, reliability, summary, wilson
from diagnosis_campaign.verdict import judged
from diagnosis_validation import main, read
from scipy.stats import binomtest

from hil_sim.effects.entry import Entry
from hil_sim.scenarios.random import SMALL, random_scenario
from hil_sim.trials import without_effects

LABORATORY = random_scenario(7, SMALL, (), 1.0)[0]
TRIAL = without_effects(LABORATORY, LABORATORY.trials[0], 7)


def number(value, half):
    value, half = np.asarray(value, dtype=float), np.asarray(half, dtype=float)
    ci95 = np.stack([value - half, value + half], axis=-1)
    return {"value": value.tolist(), "ci95": ci95.tolist(), "unit": "SI"}


def finding(effect, where, **numbers):
    return {"effect": effect, "where": list(where) if len(where) > 1 else where[0], "parameters": numbers}


def stage(alpha=None, loads=None):
    return {"parameters": {"alpha": alpha or number(np.zeros(5), np.ones(5)), "loads": loads or {}}}


def compared(said, hidden):
    return parameters(said, hidden, TRIAL)


def said(hidden, *found, ties=(), structure=False):
    return judged(hidden, found, ties, structure=structure)


# Verdicts


@pytest.mark.parametrize(
    ("hidden", "found", "ties", "structure", "word"),
    [
        (["accel.scale@x"], ["accel.scale@x"], [], False, "right"),
        (["accel.scale@x"], ["accel.scale@y"], [], False, "right"),
        (["accel.scale@x"], ["accel.bias@x"], [], False, "family"),
        (["accel.scale@x"], ["friction.coulomb@joint1"], [], False, "wrong"),
        (["accel.scale@x"], ["accel.scale@x", "friction.coulomb@joint1"], [], False, "extra"),
        (["accel.scale@x"], [], [], False, "missed"),
        (["accel.scale@x"], [], [], True, "unattributed"),
        (["accel.scale@x"], ["unattributed"], [], True, "unattributed"),
        (["accel.scale@x"], ["inertia.extra@tip"], [["inertia.extra@tip", "accel.scale@x"]], False, "tie"),
        # With something left over the two are not the same; a tie with something else is none, nor is one
        # that stands beside another wrong name.
        (["accel.scale@x"], ["inertia.extra@tip"], [["inertia.extra@tip", "accel.scale@x"]], True, "wrong"),
        (["accel.scale@x"], ["inertia.extra@tip"], [["inertia.extra@tip", "accel.bias@x"]], False, "wrong"),
        (
            ["accel.scale@sensor"],
            ["inertia.extra@tip"],
            [["inertia.extra@tip", "accel.scale@x"]],
            False,
            "wrong",
        ),
        (
            ["accel.scale@x"],
            ["inertia.extra@tip", "load.drift@load"],
            [["inertia.extra@tip", "accel.scale@x"]],
            False,
            "wrong",
        ),
        (["accel.scale@x", "load.drift@load"], ["load.drift@load"], [], False, "partial"),
        (["accel.scale@x", "load.drift@load"], ["load.drift@load", "accel.scale@x"], [], False, "right"),
        (
            ["friction.coulomb@joint1", "actuator.offset@joint1"],
            ["friction.asymmetric@joint1"],
            [["friction.asymmetric@joint1", "friction.coulomb@joint1", "actuator.offset@joint1"]],
            False,
            "tie",
        ),
        ([], [], [], False, "right"),
        ([], ["accel.bias@x"], [], False, "false alarm"),
        ([], [], [], True, "false structure"),
        (["outside.push@tip"], ["accel.bias@x"], [], True, "pinned"),
        (["outside.push@tip"], ["unattributed"], [], True, "described"),
        (["outside.push@tip"], [], [], False, "unseen"),
    ],
)
def test_verdicts(hidden, found, ties, structure, word):
    assert said(hidden, *found, ties=ties, structure=structure).word == word


@pytest.mark.parametrize(
    ("hidden", "found", "right"),
    [
        ("accel.scale@x", "accel.scale@y", False),
        ("accel.scale@sensor", "accel.scale@x+y", True),
        ("friction.coulomb@joint1+joint2", "friction.coulomb@joint2+joint1", True),
        ("friction.coulomb@joint1+joint2", "friction.coulomb@joint1", False),
        ("accel.delay@sensor", "accel.delay@sensor", True),
        ("accel.delay@sensor", "accel.bias@x", None),
    ],
)
def test_the_place_counts_where_the_name_is_right(hidden, found, right):
    assert said([hidden], found).place_right is right


def test_an_effect_in_two_entries_is_at_both_places():
    verdict = said(["friction.coulomb@joint1+joint2"], "friction.coulomb@joint1", "friction.coulomb@joint2")
    assert (verdict.word, verdict.place_right) == ("right", True)


def test_the_first_name_is_judged_by_itself():
    hidden = ["accel.scale@x", "load.drift@load"]
    assert said(hidden, "load.drift@load", "accel.bias@x").first_right
    assert not said(hidden, "accel.bias@x", "load.drift@load").first_right
    assert said(hidden, "unattributed@", "load.drift@load").first_right


# Numbers


@pytest.mark.parametrize(("count", "of"), [(0, 10), (10, 10), (3, 17), (95, 100)])
def test_intervals_of_rates_are_wilsons(count, of):
    reference = binomtest(count, of).proportion_ci(method="wilson")
    assert wilson(count, of) == pytest.approx((reference.low, reference.high), abs=1e-6)


def test_a_rate_of_nothing_says_nothing():
    assert rate([], lambda line: True)["ci95"] == [0.0, 1.0]


def test_bias_is_in_per_cent_and_in_half_widths():
    scenario, _ = random_scenario(7, SMALL, (), 1.0)
    load = scenario.world.loads["spring_L1"]
    alpha = np.array(scenario.world.robot.alpha)
    m, K = load.M_kg[0][0], np.array(load.K_N_per_m)
    said = stage(
        alpha=number(1.1 * alpha, 0.05 * alpha),
        loads={
            "spring_L1": {
                "M": number(0.97 * m * np.eye(2), 0.06 * m * np.eye(2)),
                "K": number(1.02 * K, np.full((2, 2), 1e3)),
            }
        },
    )
    found = bias(said, scenario)
    assert found["alpha"]["percent"] == pytest.approx(10.0)
    assert found["alpha"]["half_widths"] == pytest.approx(2.0)
    assert (found["alpha"]["covered"], found["alpha"]["of"]) == (0, 5)
    assert found["M"]["percent"] == pytest.approx(3.0)
    assert found["M"]["half_widths"] == pytest.approx(0.5)
    assert (found["M"]["covered"], found["M"]["of"]) == (1, 1)
    assert found["K"]["percent"] == pytest.approx(2.0)
    assert (found["K"]["covered"], found["K"]["of"]) == (3, 3)


def test_a_load_is_judged_by_all_of_its_stiffness():
    """A skew part of 100 N/m, which the papers' symmetric K cannot hold, is an error of the first stage."""
    scenario, _ = random_scenario(7, SMALL, (), 1.0)
    table = {"effect": "load.coupling", "K": [[0.0, -100.0], [100.0, 0.0]]}
    skew = scenario.model_validate({**scenario.model_dump(), "effects": [table]})
    K = np.array(scenario.world.loads["spring_L1"].K_N_per_m)
    wide = np.full((2, 2), 60.0)
    papers = bias(stage(loads={"spring_L1": {"K": number(K, wide)}}), skew)["K"]
    whole = K + np.array(table["K"])
    assert papers["percent"] == pytest.approx(100 * np.sqrt(2) * 100 / np.linalg.norm(whole))
    assert (papers["covered"], papers["of"]) == (2, 4)
    assert bias(stage(loads={"spring_L1": {"K": number(whole, wide)}}), skew)["K"]["percent"] == 0.0


def test_a_drift_found_with_more_degrees_is_compared_degree_by_degree():
    hidden = Entry("clock.drift", ("sensor",), (), {"seconds": 0.004})
    said = finding(
        "clock.drift",
        ("sensor",),
        seconds=number(0.006, 1e-4),
        legendre=number([0.0041, 0.0002], [2e-4, 1e-4]),
    )
    row = compared(said, hidden)
    assert "seconds" not in row
    assert row["legendre"]["relative"] == pytest.approx(np.hypot(1e-4, 2e-4) / 0.004)
    assert (row["legendre"]["covered"], row["legendre"]["of"]) == (1, 2)


def test_own_parameters_are_compared_place_by_place():
    hidden = Entry("friction.coulomb", ("joint1", "joint2"), (), {"torque": [0.1, 0.2]})
    said = finding("friction.coulomb", ("joint2", "joint1"), torque=number([0.19, 0.1], [0.02, 0.001]))
    row = compared(said, hidden)["torque"]
    assert row["truth"] == [0.2, 0.1]
    assert row["relative"] == pytest.approx(0.01 / np.hypot(0.1, 0.2))
    assert (row["covered"], row["of"]) == (2, 2)


def test_own_parameters_of_one_place_of_two():
    hidden = Entry("friction.quadratic", ("joint2",), (), {"coefficient": 0.2})
    one = finding("friction.quadratic", ("joint2",), coefficient=number(0.22, 0.01))
    assert compared(one, hidden)["coefficient"]["relative"] == pytest.approx(0.1)
    assert compared(one, hidden)["coefficient"]["covered"] == 0
    both = finding("friction.quadratic", ("joint1", "joint2"), coefficient=number([0.5, 0.2], [0.1, 0.1]))
    assert compared(both, hidden)["coefficient"]["relative"] == pytest.approx(0.0)
    elsewhere = finding("friction.quadratic", ("joint1",), coefficient=number(0.2, 0.1))
    assert compared(elsewhere, hidden) == {}


def test_a_gain_errs_against_its_distance_from_one():
    hidden = Entry("accel.scale", ("x",), (), {"gain": 1.02})
    said = finding("accel.scale", ("x",), gain=number(1.021, 0.002))
    assert compared(said, hidden)["gain"]["relative"] == pytest.approx(0.05)


def test_phases_go_round():
    hidden = Entry("encoder.eccentricity", ("joint1",), (), {"amplitude_rad": 0.01, "phase_rad": 6.2})
    said = finding("encoder.eccentricity", ("joint1",), phase_rad=number(6.2 - 2 * np.pi + 0.05, 0.06))
    row = compared(said, hidden)["phase_rad"]
    assert row["relative"] is None
    assert row["covered"] == 1


def test_a_compliance_is_known_by_its_ratio():
    hidden = Entry(
        "elastic.transmission",
        ("joint1",),
        (),
        {"stiffness": 20.0, "motor_inertia": 0.01, "damping_ratio": 0.05},
    )
    said = finding("elastic.transmission", ("joint1",), inertia_over_stiffness=number(5.5e-4, 1e-5))
    assert compared(said, hidden)["inertia_over_stiffness"]["relative"] == pytest.approx(0.1)


def test_a_skew_matrix_is_compared_whole():
    hidden = Entry("load.coupling", ("load",), (), {"K": [[0.0, -20.0], [20.0, 0.0]], "M": 0.0})
    said = finding(
        "load.coupling", ("load",), K=number([[0.0, -19.0], [19.0, 0.0]], [[0.0, 2.0], [2.0, 0.0]])
    )
    row = compared(said, hidden)["K"]
    assert row["relative"] == pytest.approx(0.05)
    assert (row["covered"], row["of"]) == (4, 4)


def test_a_length_errs_against_its_distance_from_the_declared_one():
    hidden = Entry("geometry.link_length", ("joint2",), (), {"length_m": 0.2717})
    said = finding("geometry.link_length", ("joint2",), length_m=number(0.2712, 0.0004))
    assert compared(said, hidden)["length_m"]["relative"] == pytest.approx(0.0005 / 0.005)


def test_what_differs_from_trial_to_trial_is_compared_trial_by_trial():
    hidden = Entry(
        "load.drift",
        ("load",),
        (),
        {"rate": [9.0, 9.0]},
        per_trial={"a_01": {"rate": [1.0, 0.0]}, "a_02": {"rate": [0.0, 1.0]}},
    )
    by_trial = {
        "rate": {
            "value": {"a_01": [1.1, 0.0], "a_02": [0.0, 1.0]},
            "ci95": {"a_01": [[1.0, 1.2], [-0.1, 0.1]], "a_02": [[-0.1, 0.1], [0.9, 1.1]]},
        }
    }
    said = {"effect": "load.drift", "where": "load", "parameters": by_trial}
    rows = compared(said, hidden)
    assert rows["rate@a_01"]["relative"] == pytest.approx(0.1)
    assert rows["rate@a_02"]["relative"] == pytest.approx(0.0)
    # One direction for both trials is no answer to that.
    assert compared(finding("load.drift", ("load",), rate=number([1.0, 0.0], [0.1, 0.1])), hidden) == {}


# What an answer says


TRIALS = {"free_01": None, "spring_L1_01": "spring_L1", "spring_L1_02": "spring_L1"}


@pytest.mark.parametrize(
    ("when", "trials"),
    [
        ("all", {"free_01", "spring_L1_01", "spring_L1_02"}),
        ("free", {"free_01"}),
        ("load", {"spring_L1_01", "spring_L1_02"}),
        (["spring_L1"], {"spring_L1_01", "spring_L1_02"}),
        (["spring_L1_02"], {"spring_L1_02"}),
    ],
)
def test_when_an_effect_is_said_to_act(when, trials):
    assert acts_in({"when": when}, TRIALS) == trials


def test_an_answer_without_when_says_all_trials():
    assert acts_in({}, TRIALS) == set(TRIALS)


def test_a_parameter_without_an_interval_is_known_to_nobody():
    ((name, trial, found),) = values({"ppm": {"value": 3.0, "ci95": None}})
    assert (name, trial, float(found.value)) == ("ppm", None, 3.0)
    assert np.isinf(found.ci95).all()


def test_confidence_is_held_against_how_often_names_are_right():
    lines = [
        {"effects": ["a.b@x"], "found": ["a.b@x"], "confidence": [0.95]},
        {"effects": ["a.b@x"], "found": ["a.c@x"], "confidence": [0.92]},
        {"effects": ["a.b@x"], "found": ["a.b@x"], "confidence": [None]},
    ]
    row = reliability(lines)["0.9 to 1"]
    assert (row["count"], row["of"]) == (1, 2)
    assert row["mean"] == pytest.approx(0.935)


# The file


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """One clean study, one known effect."""
    out = tmp_path_factory.mktemp("campaign") / "lines.jsonl"
    return out, run(out)


def run(out):
    seeds = ["--seed", "200003", "--seed", "240000"]
    result = CliRunner().invoke(main, ["run", str(out), "--first-seed", "200000", *seeds])
    assert result.exit_code == 0, result.output
    return result.output


def test_lines_hold_truth_verdict_errors_and_biases(campaign):
    lines = {line["seed"]: line for line in read(campaign[0])}
    known = lines[200003]
    assert known["effects"][0].startswith("friction.quadratic@")
    assert known["reached"][known["effects"][0]] == pytest.approx(known["strength"], rel=0.1)
    assert known["truth"][0]["coefficient"] is not None
    assert max(known["over_floor"]["before"].values()) > 2.0
    assert known["bias"]["before"]["K"]["of"] == 3
    assert known["seconds"]["diagnose"] > 0
    # Nothing is hidden, so the same papers' model on the same data leaves exactly the floor.
    assert all(v == pytest.approx(1.0, abs=1e-9) for v in lines[240000]["over_floor"]["before"].values())


def test_a_campaign_goes_on_where_it_stopped(campaign, tmp_path):
    out = tmp_path / "lines.jsonl"
    whole = campaign[0].read_text()
    out.write_text(whole)
    assert "0 studies to run, 2 are there" in run(out)
    assert out.read_text() == whole
    out.write_text(whole[:-40])  # the machine went off while a line was written
    assert "1 studies to run, 1 are there" in run(out)
    assert {line["seed"] for line in read(out)} == {200003, 240000}


def test_the_table_counts_what_the_lines_say(campaign):
    lines = read(campaign[0])
    numbers = summary(lines)
    assert numbers["studies"] == 2
    assert numbers["goals"]["false alarms"]["of"] == 1
    json.dumps(numbers)
    text = page(numbers, "a command")
    assert "a command" in text
    wrong = [
        {**line, "verdict": "wrong", "found": ["load.drift@load"]}
        for line in lines
        if line["part"] == "known"
    ]
    assert "load.drift@load" in page(summary(wrong), "a command")
    goal = summary(wrong)["goals"]["right or a correct tie, one effect at 2 floors and above"]
    assert (goal["count"], goal["of"]) == (0, 1)
