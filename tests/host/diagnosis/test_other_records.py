"""A saved model judged on other records, against errors worked out by hand and truths that were put in."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from impid_host.cli import cli
from impid_host.diagnosis.other_records import judge
from impid_host.diagnosis.saved import read_model
from impid_host.errors import InputError, UndeterminedError
from impid_host.study.folder import write_study
from impid_host.study.importing import import_logs
from impid_host.study.model import RobotLog, RobotSetup, Setup, Study, Trial

from .machines import Case, build, on_joint

MASS, VISCOUS, DRY, OFFSET = 12.0, 30.0, 8.0, 5.0


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, [str(a) for a in arguments], catch_exceptions=False)


def axis(
    name: str, *, amplitude: float = 0.1, hz: float = 0.8, offset: float = OFFSET, tone: float = 0.0
) -> Study:
    """A sliding axis, x = a sin wt: F = M x'' + Fv x' + Fc sign x' + offset + a tone at 30 Hz."""
    t = np.arange(0.0, 20.0, 1e-3)
    w = 2 * np.pi * hz
    x, v, a = amplitude * np.sin(w * t), amplitude * w * np.cos(w * t), -amplitude * w**2 * np.sin(w * t)
    force = MASS * a + VISCOUS * v + DRY * np.sign(v) + offset + tone * np.sin(2 * np.pi * 30.0 * t)
    log = RobotLog(t=t, theta=x[:, None], tau=force[:, None])
    return Study(name, Setup(robot=RobotSetup("slide-1d")), (Trial("free_01", "free", "free", log),))


def stage(
    alpha: list[float],
    terms: list[str],
    effects: list[dict[str, object]] | None = None,
    added: str | None = None,
) -> dict[str, object]:
    return {
        "added": added,
        "structure": {"terms": terms, "gravity": False},
        "alpha": alpha,
        "load_values": {},
        "effects": effects or [],
    }


TEXTBOOK = stage([MASS, VISCOUS, DRY, OFFSET], ["friction.coulomb", "actuator.offset"])


def coulomb(torque: float) -> dict[str, object]:
    return _effect("friction.coulomb", torque)


def constant(torque: float) -> dict[str, object]:
    return _effect("actuator.offset", torque)


def _effect(name: str, torque: float) -> dict[str, object]:
    part = {"where": ["joint1"], "shape": 0.0, "beta": [torque], "covariance": [[0.0]]}
    return {"effect": name, "parts": [part]}


def model(folder: Path, *stages: dict[str, object], textbook: dict[str, object] | None = TEXTBOOK) -> Path:
    """A model file with the given stages, written by hand."""
    path = folder / "model.json"
    last = stages[-1]
    robot = {"model": "slide-1d", "names": ["M", "Fv"], "alpha": [MASS, VISCOUS]}
    head = {"format": "impid-model/1", "study": "first day", "robot": robot, "effects": last["effects"]}
    path.write_text(json.dumps(head | {"stages": list(stages), "textbook": textbook}))
    return path


def rms(answer: object, band: int, number: int) -> float:
    return float(answer.bands[band].channels["tau1"].stages[number].error.rms)  # type: ignore[attr-defined]


def test_the_error_is_what_the_model_lacks(tmp_path: Path) -> None:
    """In a band far above the motion a square wave of 8 N and a constant of 5 N are sqrt(64 + 25) N rms."""
    path = model(tmp_path, stage([MASS, VISCOUS], []))
    answer = judge(read_model(path), [axis("other")])
    assert [band.cutoff_hz for band in answer.bands] == [4.5, 20.0, 50.0]
    wide = answer.bands[2].channels["tau1"]
    assert rms(answer, 2, 0) == pytest.approx(np.hypot(DRY, OFFSET), rel=0.02)
    # Below 4.5 Hz the square wave keeps its first and third harmonic, 4/pi and 4/(3 pi), at 0.8 and 2.4
    # Hz, and of
    # the fifth, at 4.0 Hz, what the fifth-order filter lets pass twice.
    passed = 1 / (1 + (4.0 / 4.5) ** 10)
    low = DRY * 4 / np.pi * np.array([1.0, 1 / 3, passed / 5])
    assert rms(answer, 0, 0) == pytest.approx(np.sqrt(0.5 * np.sum(low**2) + OFFSET**2), rel=0.02)
    assert wide.textbook is not None
    assert wide.textbook.rms < 0.1
    # The log itself: M x'' and Fv x' are at right angles, dry friction goes with the speed.
    w, a = 2 * np.pi * 0.8, 0.1
    along = (VISCOUS * a * w) ** 2 / 2 + 2 * DRY * VISCOUS * a * w * 2 / np.pi + DRY**2
    logged = np.sqrt((MASS * a * w**2) ** 2 / 2 + along + OFFSET**2)
    share = wide.stages[0].error.relative_percent
    assert share == pytest.approx(100 * np.hypot(DRY, OFFSET) / logged, rel=0.02)


def test_a_band_shows_only_what_lies_below_it(tmp_path: Path) -> None:
    """A tone at 30 Hz is in the band of 50 Hz, and neither in that of 20 nor in that of 4.5 Hz."""
    path = model(tmp_path, TEXTBOOK)
    quiet, loud = (judge(read_model(path), [axis("other", tone=level)]) for level in (0.0, 4.0))
    more = [np.sqrt(max(rms(loud, k, 0) ** 2 - rms(quiet, k, 0) ** 2, 0.0)) for k in range(3)]
    assert more[0] < 1e-3
    assert more[1] < 0.1
    assert more[2] == pytest.approx(4.0 / np.sqrt(2), rel=0.05)


def test_what_belongs_to_the_record_stays_behind_or_is_fitted_anew(tmp_path: Path) -> None:
    """The first day's constant of 5 N is -20 N on the other; dry friction is the machine's and goes along."""
    effects = [coulomb(DRY), constant(OFFSET)]
    stages = (
        stage([MASS, VISCOUS], []),
        stage([MASS, VISCOUS], [], effects[:1], "friction.coulomb@joint1"),
        stage([MASS, VISCOUS], [], effects, "actuator.offset@joint1"),
    )
    other = axis("other", offset=-20.0)
    answer = judge(read_model(model(tmp_path, *stages)), [other])
    assert rms(answer, 2, 0) == pytest.approx(np.hypot(DRY, 20.0), rel=0.02)
    assert rms(answer, 2, 1) == pytest.approx(20.0, rel=0.01)
    assert rms(answer, 2, 2) == pytest.approx(20.0, rel=0.01)
    assert answer.left_out == ("actuator.offset@joint1: it belongs to the recording in which it was found",)
    again = judge(read_model(model(tmp_path, *stages)), [other], refit_record=True)
    assert rms(again, 2, 1) == pytest.approx(20.0, rel=0.01)
    assert rms(again, 2, 2) < 0.1
    assert again.left_out == ()
    assert again.refitted == ("actuator.offset@joint1: torque -20",)
    # The textbook's constant is the record's own as well.
    book, carried = (own.bands[2].channels["tau1"].textbook for own in (again, answer))
    assert book is not None
    assert carried is not None
    assert book.rms < 0.1
    assert carried.rms == pytest.approx(25.0, rel=0.01)


def test_the_same_effect_is_worth_the_same_whatever_the_other_record_is(tmp_path: Path) -> None:
    """Faster and wider motion: a model of the machine alone holds there too."""
    path = model(tmp_path, stage([MASS, VISCOUS], [], [coulomb(DRY), constant(OFFSET)]))
    for other in (axis("slow", amplitude=0.02, hz=0.5), axis("fast", amplitude=0.3, hz=1.5)):
        answer = judge(read_model(path), [other], refit_record=True)
        assert rms(answer, 1, 0) < 0.1


def test_several_records_are_taken_together(tmp_path: Path) -> None:
    path = model(tmp_path, stage([MASS, VISCOUS], [], [coulomb(DRY)]))
    ten, thirty = axis("ten", offset=10.0), axis("thirty", offset=30.0)
    answer = judge(read_model(path), [ten, thirty])
    assert answer.studies == ("ten", "thirty")
    assert rms(answer, 2, 0) == pytest.approx(np.sqrt((10.0**2 + 30.0**2) / 2), rel=0.01)


def test_a_slow_log_is_judged_as_far_as_it_goes(tmp_path: Path) -> None:
    study = axis("slow log")
    (trial,) = study.trials
    log = trial.robot
    slow = RobotLog(t=log.t[::10], theta=log.theta[::10], tau=log.tau[::10])
    study = replace(study, trials=(replace(trial, robot=slow),))
    saved = read_model(model(tmp_path, TEXTBOOK))
    answer = judge(saved, [study])
    assert [band.cutoff_hz for band in answer.bands] == [4.5, 20.0]
    assert answer.skipped_hz == (50.0,)
    with pytest.raises(UndeterminedError, match="show nothing above 40 Hz"):
        judge(saved, [study], (60.0,))


def test_a_model_without_stages_or_of_another_robot_is_refused(tmp_path: Path) -> None:
    path = model(tmp_path, TEXTBOOK)
    document = json.loads(path.read_text())
    path.write_text(json.dumps(document | {"stages": []}))
    with pytest.raises(InputError, match="holds no stages"):
        judge(read_model(path), [axis("other")])
    document["robot"]["model"] = "joint-1d"
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match="is of a robot joint-1d, the study's is slide-1d"):
        judge(read_model(path), [axis("other")])


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two days of one arm with dry friction and springs as loads, as folders."""
    folder = tmp_path_factory.mktemp("lab")
    hidden = [on_joint(0, lambda q, w: 0.15 * np.tanh(w / 1e-4))]
    for name, seed in (("A", 501), ("B", 502)):
        case = Case(seed=seed, seconds=20.0, device=False, torque=hidden, force_sensor=True)
        write_study(build(case, folder), folder / name)
    return folder


def test_a_fit_is_saved_and_judged_on_another_day(lab: Path) -> None:
    """`fit` without effects lacks the friction of 0.15 N m, the textbook's model beside it has it."""
    saved, out = lab / "plain.json", lab / "judged.json"
    assert run("fit", lab / "A", "--save-model", saved).exit_code == 0
    result = run("judge", saved, lab / "B", "--json", out)
    assert result.exit_code == 0, result.output
    document = json.loads(out.read_text())
    assert document["format"] == "impid-judge/1"
    assert (document["fitted_on"], document["studies"]) == (["A"], ["B"])
    assert set(document) >= {"model", "bands", "checks", "trusted"}
    channels = document["bands"][0]["channels"]
    assert set(channels) >= {"tau1", "tau2", "fsx", "fsy"}
    first, book = channels["tau1"]["stages"][0], channels["tau1"]["textbook"]
    assert first["added"] is None
    assert first["rms"] > 3 * book["rms"]
    # The noise of 0.01 N m at 1 kHz, of which 4.5 Hz let pass a hundredth part.
    assert book["rms"] < 0.01
    assert first["relative_percent"] > 3 * book["relative_percent"]
    assert "found on these very data" not in result.output


def test_judging_a_model_on_its_own_data_says_so(lab: Path) -> None:
    saved = lab / "own.json"
    assert run("fit", lab / "A", "--with", "friction.coulomb", "--save-model", saved).exit_code == 0
    result = run("judge", saved, lab / "A", "--band", "4.5")
    assert result.exit_code == 0
    assert "found on these very data" in result.output
    assert "below 20 Hz" not in result.output


MAPPINGS = Path(__file__).resolve().parents[3] / "docs" / "mappings"


@pytest.mark.measured
def test_emps_by_the_textbook_of_its_first_half(measured_data: Path, tmp_path: Path) -> None:
    """Its authors leave 4.08 % below some 40 Hz with dry friction and offset, fitted on the whole record."""
    whole = import_logs([measured_data / "emps" / "bangbang.parquet"], MAPPINGS / "emps.toml", "emps")
    (trial,) = whole.trials
    log, half = trial.robot, len(trial.robot.t) // 2
    for name, rows in (("first", slice(None, half)), ("second", slice(half, None))):
        part = RobotLog(t=log.t[rows], theta=log.theta[rows], tau=log.tau[rows])
        write_study(replace(whole, name=name, trials=(replace(trial, robot=part),)), tmp_path / name)
    saved, out = tmp_path / "model.json", tmp_path / "judged.json"
    assert run("fit", tmp_path / "first", "--save-model", saved, "--validate", "0").exit_code == 0
    result = run("judge", saved, tmp_path / "second", "--json", out, "--band", "40")
    assert result.exit_code == 0, result.output
    (band,) = json.loads(out.read_text())["bands"]
    errors = band["channels"]["tau1"]
    assert errors["textbook"]["relative_percent"] == pytest.approx(4.08, abs=0.7)
    # Without dry friction, about 20 N of 54 N rms less what viscous friction takes up.
    assert errors["stages"][0]["relative_percent"] > 15.0
