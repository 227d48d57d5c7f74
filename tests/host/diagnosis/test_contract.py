"""Whatever the study, the answer keeps to the diagnosis format, which contract.py has typed."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from impid_host.cli import cli
from impid_host.study.folder import write_study
from impid_host.study.model import Study

from .contract import Contract
from .machines import Case, build


def answer_of(study: Study, folder: Path) -> Contract:
    """Through the command, as anyone would get it; NaN and Infinity are no JSON."""
    write_study(study, folder / "study")
    arguments = ["diagnose", str(folder / "study"), "--json", str(folder / "d.json")]
    result = CliRunner().invoke(cli, arguments, catch_exceptions=False)
    assert result.exit_code == 0, result.output

    def refuse(word: str) -> float:
        raise AssertionError(f"{word} in JSON")

    content = json.loads((folder / "d.json").read_text(), parse_constant=refuse)
    return Contract.model_validate_json(json.dumps(content))


def dry(m, load):
    out = np.zeros_like(m.q)
    out[:, 0] = 0.03 * np.tanh(m.w[:, 0] / 1e-4)
    return out


def bump(m, load):
    out = np.zeros_like(m.q)
    out[:, 0] = 0.03 * np.exp(-0.5 * ((m.q[:, 0] - 0.8) / 0.03) ** 2)
    return out


def test_clean_study_with_a_force_sensor(make, tmp_path: Path) -> None:
    answer = answer_of(make(41, force_sensor=True), tmp_path)
    assert len(answer.stages) == 1
    assert set(answer.stages[0].validation_rms) == {"tau1", "tau2", "fx", "fy", "fsx", "fsy"}
    assert set(answer.stages[0].parameters.loads) == {"spring_A0", "spring_B0"}
    assert not answer.unexplained.above_noise_floor


def test_friction_on_both_joints_is_one_entry(make, tmp_path: Path) -> None:
    def both(m, load):
        return 0.03 * np.tanh(m.w / 1e-4)

    answer = answer_of(make(42, torque=[both]), tmp_path)
    added = answer.stages[-1].added
    assert added is not None
    assert (added.effect, added.where) == ("friction.coulomb", ["joint1", "joint2"])
    assert added.parameters["torque"].value == pytest.approx([0.03, 0.03], rel=0.03)
    assert added.parameters["torque"].unit == "N*m"
    assert added.evidence.p_value < 1e-12


def test_unknown_structure_is_the_last_stage_and_has_a_shape(make, tmp_path: Path) -> None:
    answer = answer_of(make(43, torque=[bump], torque_noise=0.005), tmp_path)
    added = answer.stages[-1].added
    assert added is not None
    assert (added.effect, added.parameters, added.evidence.runner_up) == ("unattributed", {}, None)
    assert answer.unexplained.above_noise_floor
    assert "theta1" in [row.variable for row in answer.unexplained.structure]
    # What is unexplained is not said of the stage in which the curve stands, but of what has a name.
    assert answer.unexplained.share_of_residual > 0.5


def test_without_a_module(make, tmp_path: Path) -> None:
    answer = answer_of(make(44, device=False, torque=[dry]), tmp_path)
    assert answer.stages[-1].added is not None
    assert answer.stages[-1].added.effect == "friction.coulomb"


@pytest.mark.parametrize("model", ["slide-1d", "joint-1d"])
def test_one_axis(model: str, tmp_path: Path) -> None:
    def friction(m):
        return 0.5 * np.tanh(m.w / 1e-4)

    case = Case(model, seed=45, seconds=20.0, loaded=0, device=False, torque=[friction])
    answer = answer_of(build(case, tmp_path), tmp_path)
    assert set(answer.stages[0].validation_rms) == {"tau1"}
    added = answer.stages[-1].added
    assert added is not None
    assert (added.effect, added.where) == ("friction.coulomb", "joint1")
    assert added.parameters["torque"].unit == ("N" if model == "slide-1d" else "N*m")
