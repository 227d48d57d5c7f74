"""The plan of the campaign that judges diagnoses is balanced."""

from typing import Any

import numpy as np
import pytest
from diagnosis_campaign.cases import (
    CLEAN_NOISES,
    KNOWN,
    OUTSIDE,
    SAME_THING,
    SOMETIMES,
    STRENGTHS,
    Sizes,
    plan,
)
from diagnosis_campaign.situations import SITUATIONS

from hil_sim.effects import catalogue
from hil_sim.scenarios.random import SMALL, random_scenario
from hil_sim.scenarios.random_effects import drawn
from hil_sim.trials import without_effects

LABORATORY = random_scenario(7, SMALL, (), 1.0)[0]
TRIAL = without_effects(LABORATORY, LABORATORY.trials[0], 7)


def test_every_study_has_a_seed_of_its_own():
    seeds = [case.seed for case in plan(200_000, Sizes())]
    assert len(set(seeds)) == len(seeds)
    assert min(seeds) >= 200_000
    assert max(seeds) < 250_000


def test_every_effect_meets_every_strength_as_often_as_asked():
    cases = plan(1000, Sizes(each=3))
    for name in KNOWN:
        strengths = [
            case.strength for case in cases if case.part == "known" and case.effects[0].startswith(name + "@")
        ]
        assert sorted(strengths) == sorted(STRENGTHS * 3)


def test_the_sizes_are_those_asked_for():
    cases = plan(1000, Sizes())
    together = [len(case.effects) for case in cases if case.part == "together"]
    assert (together.count(2), together.count(3)) == (36, 18)
    noises = [case.noise for case in cases if case.part == "clean"]
    assert {noise: noises.count(noise) for noise in CLEAN_NOISES} == dict.fromkeys(CLEAN_NOISES, 25)
    outside = [case.effects[0].partition("@")[0] for case in cases if case.part == "outside"]
    assert {name: outside.count(name) for name in OUTSIDE} == dict.fromkeys(OUTSIDE, 5)


def test_an_interrupted_campaign_is_a_smaller_one():
    """Half of the plan has about half of everything: no effect, strength or part is left to the end."""
    cases = plan(1000, Sizes(each=2))
    half = cases[: len(cases) // 2]
    counts = [
        sum(case.effects[0].startswith(name + "@") for case in half if case.part == "known") for name in KNOWN
    ]
    assert set(counts) <= {3, 4, 5}
    for part in ("together", "outside", "clean"):
        whole = sum(case.part == part for case in cases)
        assert sum(case.part == part for case in half) == pytest.approx(whole / 2, abs=0.1 * whole)


def test_more_studies_are_added_to_those_that_there_are():
    few = {case.seed: case for case in plan(1000, Sizes(each=1, together=10, clean=10, outside=2))}
    many = {case.seed: case for case in plan(1000, Sizes())}
    assert all(many[seed] == case for seed, case in few.items())


def test_what_no_one_could_tell_apart_is_not_asked_together():
    for case in plan(1000, Sizes(together=2000)):
        names = {label.partition("@")[0] for label in case.effects}
        assert not any(same <= names for same in SAME_THING)


def test_places_are_those_of_the_catalogue():
    seen = set()
    for case in plan(1000, Sizes()):
        for label in case.effects:
            name, _, rest = label.partition(",")[0].partition("@")
            places = rest.partition(":")[0]
            assert set(places.split("+")) <= set(catalogue.ROWS[name].places)
            seen.add(label)
    assert {"friction.coulomb@joint1", "friction.coulomb@joint2", "accel.bias@x", "accel.bias@y"} <= seen


def test_every_effect_is_met_in_free_trials_and_under_load_only():
    cases = [case for case in plan(1000, Sizes(when=2)) if case.part == "when"]
    kinds: dict[Any, Any] = {}
    for case in cases:
        name, _, rest = case.effects[0].partition("@")
        kinds.setdefault(name, set()).add(rest.rpartition(":")[2])
        assert case.force_sensor or rest.endswith(":free")
    assert set(kinds) == set(SOMETIMES)
    # A part of the robot's inertia in free trials only would be a payload of the others.
    assert all(kind == {"free", "load"} for name, kind in kinds.items() if name != "inertia.extra")


def test_what_errs_with_the_force_sensor_has_one_and_payloads_are_weighed_by_half():
    cases = plan(1000, Sizes())
    assert all(case.force_sensor for case in cases if any(one.startswith("force.") for one in case.effects))
    weighed = [case.weighed for case in cases]
    assert 0.4 < np.mean(weighed) < 0.6
    assert {case.force_sensor for case in cases} == {True, False}


@pytest.mark.parametrize("one", SITUATIONS, ids=lambda one: one.name)
def test_every_case_made_by_hand_can_be_carried_out(one):
    """Its labels are read and its sizes are those that they state."""
    for label in one.effects:
        laboratory, _ = random_scenario(3, SMALL, (), 1.0, force_sensor=one.force_sensor is not False)
        entry, sized = drawn(label, laboratory, np.random.default_rng(1))
        for pair in label.split(",")[1:]:
            name, _, text = pair.partition("=")
            assert entry.values[name] == float(text)
        for trial in laboratory.trials:
            if catalogue.applies(entry, trial.name, loaded=trial.load is not None, load=trial.load):
                catalogue.apply(without_effects(laboratory, trial, 3), (entry,))
        assert sized or one.strength > 0.0
