"""A model found on one study and used on the next one of the same robot, whose truth is known."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from impid_host.cli import cli
from impid_host.diagnosis.base import base_of
from impid_host.diagnosis.result import Chosen
from impid_host.diagnosis.reuse import carried, cleaned_trials, fit_with_model
from impid_host.diagnosis.saved import SavedModel
from impid_host.diagnosis.saved_parts import SavedEffect, SavedStructure
from impid_host.errors import InputError
from impid_host.impedance.campaign import Options
from impid_host.robot.terms import robot_structure
from impid_host.study.folder import write_study
from impid_host.study.model import Study

from ..effects.closed_form import FREE, HAND, SPRING, body, recorded, term
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


ROBOT_SD = np.array([1e-4, 1e-3])


def known_spring(stiffness: float, sd: float, *, where: str = "joint1") -> SavedModel:
    """A joint of the true inertia and damping, and a spring beside it that is known to `sd`."""
    spring = SavedEffect(
        "elastic.joint",
        (where,),
        "",
        "all",
        (),
        0.0,
        np.array([stiffness, -0.6 * stiffness]),
        np.diag([sd**2, 0.0]),
    )
    return SavedModel(
        path=Path("model.json"),
        study="yesterday",
        made_by="impid",
        data_sha256={},
        robot="joint-1d",
        link_lengths_m=(),
        gravity_m_s2=(),
        names=("I", "b"),
        alpha=np.array([0.02, 0.03]),
        covariance=np.diag(ROBOT_SD**2),
        loads={},
        effects=(spring,),
        structure=SavedStructure(),
        stages=(),
        textbook=None,
        ranges=None,
    )


@pytest.fixture(scope="module")
def hand(tmp_path_factory: pytest.TempPathFactory) -> Study:
    """A limb on a joint that has a spring of 4 N m/rad about 0.6 rad beside it; no free trial."""
    case = Case(
        "joint-1d",
        seed=520,
        free=0,
        loaded=1,
        kind="arm",
        device=False,
        seconds=20.0,
        torque=[on_joint(0, lambda q, _w: 4.0 * (q - 0.6))],
    )
    return build(case, tmp_path_factory.mktemp("hand"))


def stiffness_and_sd(study: Study, saved: SavedModel) -> tuple[float, float]:
    reused = fit_with_model(study, saved, Options(), lambda _words: None)
    (load,) = reused.fit.loads
    at = load.estimate.names.index("K")
    return float(load.estimate.value[at]), float(load.estimate.sd[at])


@pytest.mark.parametrize("sd", [0.3, 1.0])
def test_an_uncertain_spring_widens_the_limbs_stiffness_by_the_delta_method(hand: Study, sd: float) -> None:
    """K_limb = K_seen - k, so that var(K_limb) = var(K_seen) + var(k) and dK / dk = -1."""
    K, exact = stiffness_and_sd(hand, known_spring(4.0, 0.0))
    other, wide = stiffness_and_sd(hand, known_spring(4.0, sd))
    assert other == pytest.approx(K)
    assert exact < 0.5 * sd
    assert wide == pytest.approx(np.hypot(exact, sd), rel=1e-3)
    without, _ = stiffness_and_sd(hand, known_spring(0.0, 0.0))
    assert without - K == pytest.approx(4.0, rel=1e-3)


def test_what_was_saved_comes_back_with_its_values_and_nothing_else(hand: Study) -> None:
    reused = fit_with_model(hand, known_spring(4.0, 0.3), Options(), lambda _words: None)
    (own,) = reused.effects
    assert own.term.label == "elastic.joint@joint1"
    assert own.beta.tolist() == [4.0, -2.4]
    elsewhere = fit_with_model(hand, known_spring(4.0, 0.3, where="joint2"), Options(), lambda _words: None)
    assert elsewhere.effects == ()
    assert elsewhere.provenance.left_out == ("elastic.joint@joint2: this study's instruments do not show it",)


def test_an_effect_of_a_load_goes_with_the_load_and_its_trials() -> None:
    parts = [recorded(name) for name in (FREE, SPRING, HAND)]
    base = base_of(parts, robot_structure(parts[0].model))
    damper = SavedEffect("load.stiffness_cubic", ("load",), "radial", "all", (), 0.0, np.ones(1), np.eye(1))
    each = replace(
        damper, variant="radial each", own=("hand", "old"), beta=np.array([5.0, 7.0]), covariance=np.eye(2)
    )
    (own, known), left = carried([damper, each], ["hand"], parts, base, None)
    assert left == []
    assert own.term.columns(parts[1], 0.0) == {}
    d = parts[2].x - parts[2].x0
    truth = np.sum(d**2, axis=1, keepdims=True) * d
    assert own.term.columns(parts[2], 0.0)["force"][..., 0] == pytest.approx(truth)
    # Each load with its own value: the hand's comes along, the spring's is not known.
    at = known.term.own.index("hand")
    assert known.beta.tolist() == [5.0 * (k == at) for k in range(len(known.term.own))]
    none, left = carried([damper], ["another"], parts, base, None)
    assert none == []
    assert left == ["load.stiffness_cubic@load: it belongs to a load that is not in this study"]


def test_a_cleaned_trial_is_the_trial_without_the_effect() -> None:
    """A closed form with a spring beside it, less the spring, is the closed form."""
    view = recorded(FREE)
    more = np.outer(4.0 * (view.theta[:, 0] - 0.6), [1.0, 0.0])
    base = base_of([view], robot_structure(view.model))
    own = Chosen(term("elastic.joint", "joint1"), 0.0, np.array([4.0, -2.4]), np.zeros((2, 2)))
    (trial,) = cleaned_trials([replace(view, tau=view.tau + more)], [own], base)
    assert trial.tau == pytest.approx(body(view.t).torque(FREE), abs=1e-9)
    assert trial.theta_dd[250:-250] == pytest.approx(body(view.t).a[250:-250], abs=1e-6)
