"""A model found on one study and used on the next one of the same robot, whose truth is known."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from impid_host.cli import cli
from impid_host.errors import InputError
from impid_host.study.folder import write_study

from .machines import Case, build, on_joint, truth

HIDDEN = [
    on_joint(0, lambda q, w: 0.15 * np.tanh(w / 1e-4)),
    on_joint(1, lambda q, w: 4.0 * (q - 0.3)),
]


def lab(seed: int, **changes: object) -> Case:
    """One laboratory: the same robot and the same hidden friction and spring, other motions and loads."""
    return replace(Case(seed=seed, seconds=20.0, device=False, torque=HIDDEN), **changes)  # type: ignore[arg-type]


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, [str(a) for a in arguments], catch_exceptions=False)


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with study A and the model found on it."""
    folder = tmp_path_factory.mktemp("lab")
    write_study(build(lab(501), folder), folder / "A")
    result = run("diagnose", folder / "A", "--save-model", folder / "model.json")
    assert result.exit_code == 0, result.output
    saved = json.loads((folder / "model.json").read_text())
    assert {row["effect"] for row in saved["effects"]} == {"elastic.joint"}
    # The next day: only loads, and the robot by what is known from A.
    write_study(build(lab(502, free=0), folder), folder / "B")
    write_study(build(lab(503), folder), folder / "C")
    return folder


def stiffness(path: Path) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    loads = json.loads(path.read_text())["loads"]
    return {
        name: (np.array(load["method1"]["K"]["value"]), np.array(load["method1"]["K"]["ci95"]))
        for name, load in loads.items()
    }


@pytest.mark.parametrize(("study", "seed"), [("B", 502), ("C", 503)])
def test_the_next_studys_stiffness_is_right_with_the_model_and_wrong_without(
    found: Path, study: str, seed: int
) -> None:
    out = found / f"{study}.json"
    result = run("fit", found / study, "--model", found / "model.json", "--json", out)
    assert result.exit_code == 0, result.output
    told = json.loads(out.read_text())["model"]
    assert told["applied"] and not told["left_out"] and not told["same_data"]
    assert told["robot"] == ("the saved model" if study == "B" else "this study's own trials")
    for name, (K, ci) in stiffness(out).items():
        true = truth(lab(seed), "AB".index(name[-1]))["K"]
        half = 0.5 * (ci[..., 1] - ci[..., 0])
        # The joint's spring is worth some 30 N/m at the hand. Eight entries: 1.5 half widths for the worst.
        assert np.all(np.abs(K - true) < 1.5 * half)
        assert half.max() < 5.0
    if study == "C":
        plain = found / "C_plain.json"
        # What the model lacks makes the plain numbers impossible or merely wrong.
        assert run("fit", found / "C", "--json", plain).exit_code in (0, 3)
        for name, (K, _) in stiffness(plain).items():
            true = truth(lab(seed), "AB".index(name[-1]))["K"]
            assert np.abs(K - true).max() > 10.0


def test_the_saved_robot_may_stand_in_for_free_trials(found: Path) -> None:
    out = found / "kept.json"
    result = run("fit", found / "C", "--model", found / "model.json", "--saved-robot", "--json", out)
    assert result.exit_code == 0, result.output
    document = json.loads(out.read_text())
    saved = json.loads((found / "model.json").read_text())
    assert document["model"]["robot"] == "the saved model"
    values = [row["value"] for row in document["robot"]["parameters"].values()]
    assert values == pytest.approx(saved["robot"]["alpha"])


def test_the_same_data_are_no_proof(found: Path) -> None:
    result = run("fit", found / "A", "--model", found / "model.json")
    assert "found on these very data" in result.output
    assert "elastic.joint@joint2" in result.output


def test_a_model_that_does_not_belong_here_is_one_line(found: Path, tmp_path: Path) -> None:
    write_study(
        build(Case("slide-1d", seed=1, loaded=0, seconds=5.0, device=False), tmp_path), tmp_path / "slide"
    )
    with pytest.raises(
        InputError, match=r"model\.json.*is of a robot planar-2r-relative, the study's is slide-1d"
    ):
        run("fit", tmp_path / "slide", "--model", found / "model.json")
    broken = tmp_path / "broken.json"
    for text, words in (
        ("{", "is no model file"),
        ('{"format": "impid-model/9"}', "not 'impid-model/1'"),
        ('{"format": "impid-model/1", "effects": []}', "`robot` is missing"),
    ):
        broken.write_text(text)
        with pytest.raises(InputError, match=words):
            run("fit", found / "C", "--model", broken)
    with pytest.raises(InputError, match="does not exist"):
        run("fit", found / "C", "--model", tmp_path / "none.json")


def test_what_belongs_to_a_recording_is_not_carried_over(found: Path, tmp_path: Path) -> None:
    saved = json.loads((found / "model.json").read_text())
    part = {"where": ["sensor"], "variant": "degree 2", "shape": 0.0, "beta": [0.01], "covariance": [[1e-8]]}
    scale = {"where": ["x"], "variant": "", "shape": 0.0, "beta": [0.01], "covariance": [[1e-8]]}
    saved["effects"] += [
        {"effect": "clock.drift", "parts": [part]},
        {"effect": "accel.scale", "parts": [scale]},
    ]
    other = tmp_path / "other.json"
    other.write_text(json.dumps(saved))
    result = run("fit", found / "C", "--model", other, "--json", tmp_path / "out.json")
    assert result.exit_code == 0, result.output
    told = json.loads((tmp_path / "out.json").read_text())["model"]["left_out"]
    assert "belongs to the recording" in told[0]
    assert "instruments do not show it" in told[1]
