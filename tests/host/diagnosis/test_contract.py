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


def answer_of(study: Study, folder: Path, *more: str) -> Contract:
    """Through the command, as anyone would get it; NaN and Infinity are no JSON."""
    write_study(study, folder / "study")
    arguments = ["diagnose", str(folder / "study"), "--json", str(folder / "d.json"), *more]
    result = CliRunner().invoke(cli, arguments, catch_exceptions=False)
    assert result.exit_code == 0, result.output

    def refuse(word: str) -> float:
        raise AssertionError(f"{word} in JSON")

    content = json.loads((folder / "d.json").read_text(), parse_constant=refuse)
    return Contract.model_validate_json(json.dumps(content))


def bump(m, load):
    out = np.zeros_like(m.q)
    out[:, 0] = 0.03 * np.exp(-0.5 * ((m.q[:, 0] - 0.8) / 0.03) ** 2)
    return out


def test_clean_study_with_a_force_sensor(make, tmp_path: Path) -> None:
    answer = answer_of(make(41, force_sensor=True), tmp_path)
    assert len(answer.stages) == 1
    assert answer.baseline == "papers"
    assert set(answer.stages[0].validation_rms) == {"tau1", "tau2", "fx", "fy", "fsx", "fsy"}
    assert set(answer.stages[0].parameters.loads) == {"spring_A0", "spring_B0"}
    assert answer.unexplained.above_noise_floor is False
    assert answer.verdict.startswith("nothing is missing")
    assert answer.trusted


def test_friction_on_both_joints_is_one_entry_and_is_saved(make, tmp_path: Path) -> None:
    def both(m, load):
        return 0.03 * np.tanh(m.w / 1e-4)

    model = tmp_path / "model.json"
    answer = answer_of(make(42, torque=[both], device=False), tmp_path, "--save-model", str(model))
    added = answer.stages[-1].added
    assert added is not None
    assert (added.effect, added.where) == ("friction.coulomb", ["joint1", "joint2"])
    assert added.parameters["torque"].value == pytest.approx([0.03, 0.03], rel=0.03)
    assert added.parameters["torque"].unit == "N*m"
    assert (added.when, added.carries) == ("all", "machine")
    assert added.evidence.gain > 5 * added.evidence.gain_se
    assert "friction.coulomb on joint1 and joint2" in answer.verdict
    saved = json.loads(model.read_text())
    assert [row["effect"] for row in saved["effects"]] == ["friction.coulomb"]
    # setup.toml, and of each trial its own file and the robot's log.
    assert len(saved["data_sha256"]) == 1 + 2 * 4


def test_unknown_structure_is_the_last_stage_and_has_a_shape(make, tmp_path: Path) -> None:
    answer = answer_of(make(43, torque=[bump], torque_noise=0.005), tmp_path)
    added = answer.stages[-1].added
    assert added is not None
    assert (added.effect, added.parameters, added.evidence.runner_up) == ("unattributed", {}, None)
    assert answer.unexplained.above_noise_floor
    assert "theta1" in [row.variable for row in answer.unexplained.structure]
    assert "without a known cause" in answer.verdict


def test_a_slides_friction_is_a_force_in_the_textbooks_robot(tmp_path: Path) -> None:
    """Four newtons of dry friction on the axis of one trial alone: the first stage has them already."""

    def friction(m):
        return 4.0 * np.tanh(m.w / 1e-4)

    case = Case("slide-1d", seed=120, free=1, loaded=0, device=False, torque=[friction])
    answer = answer_of(build(case, tmp_path), tmp_path)
    assert answer.baseline == "textbook"
    assert len(answer.stages) == 1
    assert set(answer.stages[0].validation_rms) == {"tau1"}
    alpha = answer.stages[0].parameters.alpha
    names = alpha.model_extra["names"]  # type: ignore[index]
    assert alpha.value[names.index("Fc")] == pytest.approx(4.0, rel=0.02)
    assert " N are left in tau1" in answer.verdict
