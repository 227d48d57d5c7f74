"""The prior and the weights against what was found, on numbers worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest
from impid_host.diagnosis.diagnose import diagnose
from impid_host.diagnosis.references import Reference, against_prior, against_scales, explained_by, signatures
from impid_host.diagnosis.result import Number, Stage
from impid_host.robot.model import robot_model
from impid_host.study.model import RobotSetup, Study

L1, L2 = 0.254, 0.2667
ABSOLUTE = robot_model(RobotSetup("planar-2r-absolute", (L1, L2)))
RELATIVE = robot_model(RobotSetup("planar-2r-relative", (L1, L2), (0.0, -9.81)))
PRIOR = np.array([0.06929, 0.04217, 0.04416, 0.06510, 0.07389])
# Kinetic energy of a mass m at the tip, of which alpha2 enters the equation of motion by its half.
TIP = np.array([L1**2, 2 * L1 * L2, L2**2, 0.0, 0.0])
SD = 1e-4 * PRIOR


def number(value: np.ndarray, sd: np.ndarray) -> Number:
    half = 1.96 * sd
    return Number(value, np.stack([value - half, value + half], axis=-1), "SI", np.diag(sd**2))


def compared(difference: np.ndarray) -> Reference:
    return against_prior(tuple(PRIOR), ABSOLUTE, number(PRIOR + difference, SD))


def candidates(found: Reference) -> tuple[str, ...]:
    (tie,) = found.ties
    return tie.candidates


@pytest.mark.parametrize("size", [0.0, 1e-4, -2e-3, 3e-3])
def test_a_prior_that_agrees_within_its_digits_is_silent(size: float) -> None:
    assert compared(size * PRIOR * np.array([1, -1, 1, 1, -1])) == Reference()


def test_a_prior_of_two_digits_is_not_blamed_for_the_others() -> None:
    rounded = np.array([0.069, 0.042, 0.044, 0.065, 0.074])
    found = number(rounded + 0.00049 * np.array([1, -1, 1, 0, 0]), SD)
    assert against_prior(tuple(rounded), ABSOLUTE, found) == Reference()
    assert against_prior(tuple(rounded + 1e-9), ABSOLUTE, found) != Reference()


@pytest.mark.parametrize(
    ("column", "joint"),
    [
        ([1, 0, 0, 0, 0], "joint1"),
        ([0, 0, 1, 0, 0], "joint2"),
    ],
)
def test_a_rotor_that_was_not_there_adds_to_one_inertia_alone(column: list[float], joint: str) -> None:
    found = compared(1e-3 * np.array(column))
    assert candidates(found) == (f"inertia.extra@{joint}", f"elastic.transmission@{joint}")
    assert "prior" in found.notes[0]


def test_a_mass_at_the_tip_is_known_by_its_three_inertias() -> None:
    assert candidates(compared(0.06 * TIP))[0] == "inertia.extra@tip"


def test_a_common_factor_takes_all_parameters_along_and_a_weight_would_tell() -> None:
    found = compared(-0.05 * PRIOR)
    assert candidates(found) == ("actuator.gain@joint1+joint2",)
    assert "payload_kg" in found.ties[0].tell_apart_by


def test_an_inertia_that_shrank_was_not_added() -> None:
    found = compared(np.array([0, 0, -1e-3, 0, 0]))
    assert not found.ties
    assert found.notes


def test_friction_alone_is_said_in_words() -> None:
    found = compared(np.array([0, 0, 0, 0.25 * PRIOR[3], 0]))
    assert not found.ties
    assert "alpha4 0.08138 for 0.0651" in found.notes[0]
    assert "alpha5" not in found.notes[0]


def test_a_prior_of_another_length_or_an_alpha_without_interval_is_not_compared() -> None:
    assert against_prior((0.1, 0.2), ABSOLUTE, number(PRIOR, SD)) == Reference()
    taken = Number(2 * PRIOR, np.stack([PRIOR, PRIOR], axis=-1), "SI")
    assert against_prior(tuple(PRIOR), ABSOLUTE, taken) == Reference()


def test_what_parameters_can_make_is_the_closed_form() -> None:
    absolute = signatures(ABSOLUTE, PRIOR)
    assert absolute["inertia.extra@tip"] == pytest.approx(TIP, abs=1e-12)
    assert absolute["actuator.gain@joint1+joint2"] == pytest.approx(PRIOR)
    # Between two relative angles a rotor on joint 2 has no part in the first torque: a residual shows it.
    relative = signatures(RELATIVE, np.ones(len(RELATIVE.parameter_names)))
    assert "inertia.extra@joint2" not in relative
    by_name = dict(zip(RELATIVE.parameter_names, relative["inertia.extra@tip"], strict=True))
    assert by_name["MX2"] == pytest.approx(L2)
    assert by_name["ZZ2"] == pytest.approx(L2**2)
    assert all(abs(by_name[name]) < 1e-9 for name in ("MY2", "Fv1", "Fv2"))


def stage_of(masses: dict[str, float], sd: float = 1e-3) -> Stage:
    loads = {
        name: {"M": number(mass * np.eye(2), sd * np.eye(2).diagonal()[:, None] * np.eye(2))}
        for name, mass in masses.items()
    }
    return Stage(None, {}, {}, number(PRIOR, SD), ABSOLUTE.parameter_names, loads)


def weighed(true: dict[str, float], found: dict[str, float], *, accelerometer: bool = True) -> Reference:
    return against_scales(true, stage_of(found), 2, accelerometer=accelerometer)


def test_masses_that_agree_with_their_weights_are_silent() -> None:
    assert weighed({"A": 0.5, "B": 1.2}, {"A": 0.505, "B": 1.19}) == Reference()
    assert weighed({}, {"A": 0.5}) == Reference()
    assert weighed({"A": 0.0}, {"A": 0.5}) == Reference()


def test_one_weight_leaves_all_three_open() -> None:
    found = weighed({"A": 1.0}, {"A": 1.05})
    assert set(candidates(found)) == {"actuator.gain@joint1+joint2", "accel.scale@x+y", "inertia.extra@tip"}
    assert "A 1.05 kg for 1 kg" in found.notes[0]
    assert "accel.scale@x+y" not in candidates(weighed({"A": 1.0}, {"A": 1.05}, accelerometer=False))


def test_two_weights_tell_a_factor_from_a_mass() -> None:
    assert candidates(weighed({"A": 0.4, "B": 2.0}, {"A": 0.46, "B": 2.06}))[0] == "inertia.extra@tip"
    assert candidates(weighed({"A": 0.4, "B": 2.0}, {"A": 0.42, "B": 2.1}))[0].startswith("actuator.gain")


def test_a_mass_that_is_missing_is_no_extra_inertia() -> None:
    assert "inertia.extra@tip" not in candidates(weighed({"A": 1.0}, {"A": 0.93}))


def test_shares_are_ranked_under_the_covariance() -> None:
    columns = {"friction": np.array([1.0, 0.0]), "spring": np.array([0.0, 1.0])}
    difference = np.array([1.0, 3.0])
    assert explained_by(difference, np.diag([1.0, 1.0]), columns) == ("spring",)
    assert explained_by(difference, np.diag([1.0, 100.0]), columns) == ("friction",)


def with_references(study: Study, prior: np.ndarray, weight: float) -> Study:
    setup = replace(study.setup, prior_alpha=tuple(prior))
    heavy = [
        replace(trial, payload_kg=weight) if trial.kind == "mass-spring" else trial for trial in study.trials
    ]
    return replace(study, setup=setup, trials=tuple(heavy))


def test_a_whole_study_is_silent_with_the_truth_and_says_both_without_it(make) -> None:
    seed = 41
    rng = np.random.default_rng(seed)  # the generator's draws in its order
    alpha = PRIOR * rng.uniform(0.8, 1.25, 5)
    rng.uniform(size=4)
    mass = rng.uniform(0.5, 1.6)
    study = make(seed, device=False, duration=20.0, loaded=1)
    right = diagnose(with_references(study, alpha, mass))
    assert len(right.stages) == 1
    assert not right.ambiguous
    wrong = diagnose(with_references(study, alpha * [1, 1, 0.97, 1, 1], 0.95 * mass))
    assert len(wrong.stages) == 1
    first, second = (tie.candidates for tie in wrong.ambiguous)
    assert first[0] == "inertia.extra@joint2"
    assert set(second) == {"actuator.gain@joint1+joint2", "inertia.extra@tip"}
    assert any(f"{0.95 * mass:.4g} kg" in note for note in wrong.notes)
