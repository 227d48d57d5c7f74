"""The gate of physics against matrices whose verdict is plain by hand."""

from typing import Any

import numpy as np
import pytest
from impid_host.checks import Bounded, Check, Checks, LoadNumbers, RobotNumbers, gate
from impid_host.effects.catalogue import CATALOGUE
from impid_host.impedance.matrices import Quantity
from impid_host.robot.planar_2r_absolute import Planar2RAbsolute
from impid_host.robot.terms import TERMS, RobotStructure, robot_structure

MODEL = Planar2RAbsolute(0.254, 0.2667)
STRUCTURE = RobotStructure(MODEL)
ALPHA = np.array([0.08, 0.04, 0.045, 0.06, 0.07])
THETA = np.stack([np.linspace(0.5, 1.2, 50), np.linspace(1.0, -0.6, 50)], axis=1)


def quantity(value, half, unit="N/m"):
    value = np.asarray(value, dtype=float)
    half = np.broadcast_to(np.asarray(half, dtype=float), value.shape)
    return Quantity(value, np.stack([value - half, value + half], axis=-1), unit, half / 1.96)


def robot(alpha, sd=1e-4, theta=THETA):
    numbers = RobotNumbers(
        STRUCTURE,
        MODEL.parameter_names,
        np.asarray(alpha),
        sd**2 * np.eye(5),
        theta,
    )
    return gate(robot=numbers)


def load(M=None, B=None, K=None, kind="mass-spring"):
    return gate(loads=[LoadNumbers("spring", kind, M, B, K)])


def test_a_robot_that_can_exist_passes():
    assert not robot(ALPHA).entries


def test_negative_inertia_about_joint_1_is_impossible():
    found = robot([-0.08, 0.04, 0.045, 0.06, 0.07])
    assert found.impossible and found.entries[0].where == "joint1"


def test_inertia_matrix_that_is_indefinite_only_where_the_robot_went():
    # alpha1 alpha3 = 0.0036; |h| = alpha2/2 |sin(t1 - t2)| must exceed 0.06 for a negative eigenvalue.
    alpha = [0.08, 0.15, 0.045, 0.06, 0.07]
    assert robot(alpha).impossible
    near = THETA.copy()
    near[:, 1] = near[:, 0] - 0.1
    assert not robot(alpha, theta=near).entries


@pytest.mark.parametrize(("sd", "impossible"), [(0.02, False), (0.004, True)])
def test_negative_friction_counts_beyond_its_interval(sd, impossible):
    assert robot([0.08, 0.04, 0.045, -0.01, 0.07], sd).impossible is impossible


def test_a_term_beside_the_model_is_judged_on_its_own_joint():
    structure = robot_structure(MODEL, ("friction.coulomb",))
    value = np.append(ALPHA, [0.2, -0.3])
    found = gate(robot=RobotNumbers(structure, structure.parameter_names, value, 1e-4 * np.eye(7), THETA))
    assert [(entry.what, entry.where) for entry in found] == [("result.impossible", "joint2")]
    assert "Fc2" in found.entries[0].words


@pytest.mark.parametrize("name", ["friction.coulomb", "friction.quadratic", "elastic.joint"])
def test_terms_of_fit_have_the_bound_of_their_row_in_the_catalogue(name):
    declared = min(row.low for row in CATALOGUE[name].parameters if np.isfinite(row.low))
    assert TERMS[name].nonnegative and declared == 0.0


def test_a_spring_that_pushes_along_a_diagonal():
    # Eigenvalues 400 and -100 along the diagonals, though both entries on the diagonal are positive.
    found = load(K=quantity([[150.0, 250.0], [250.0, 150.0]], 5.0))
    assert found.impossible
    assert not load(K=quantity([[150.0, 100.0], [100.0, 150.0]], 5.0)).entries


def test_an_arm_may_have_an_indefinite_stiffness_but_no_negative_mass():
    assert not load(K=quantity([[150.0, 250.0], [250.0, 150.0]], 5.0), kind="arm").entries
    assert load(M=quantity([[-0.8, 0.0], [0.0, 1.0]], 0.1, "kg"), kind="arm").impossible
    assert not load(M=quantity([[-0.05, 0.0], [0.0, 1.0]], 0.1, "kg"), kind="arm").entries


def test_sizes_and_declared_bounds():
    assert load(M=quantity([[812.0, 0.0], [0.0, 812.0]], 6.0, "kg")).impossible
    bound: dict[str, Any] = {"name": "damping_ratio", "where": "joint1", "low": 0.0, "high": 1.0}
    assert gate(parameters=[Bounded(value=-0.3, ci95=(-0.4, -0.2), **bound)]).impossible
    assert not gate(parameters=[Bounded(value=-0.1, ci95=(-0.3, 0.1), **bound)]).entries


def test_verdicts_decide_trust_and_the_gravest_comes_first():
    suspect, contradiction = (Check("torque.unit", "", v, "", {}, "") for v in ("suspect", "contradiction"))
    both = Checks.of([suspect, Check("force.sign", "", "contradiction", "", {}, "")])
    assert [entry.verdict for entry in both] == ["contradiction", "suspect"]
    assert not both.trusted and not both.impossible
    assert Checks((suspect,)).trusted and not Checks((contradiction,)).trusted


def test_evidence_is_json():
    entry = Check("x", "a+b", "suspect", "", {"m": np.array([1.0, np.nan]), "k": np.float64(2)}, "")
    assert entry.to_dict()["evidence"] == {"m": [1.0, None], "k": 2.0}
    assert entry.to_dict()["where"] == ["a", "b"]
