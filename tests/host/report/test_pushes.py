"""Pushes of known force, time and place in a study in closed form: named by `fit`, with what they moved."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from impid_host.checks.pushes import MARGIN_S, find_pushes
from impid_host.cli import cli
from impid_host.impedance.campaign import Options, default_chain, fit_study
from impid_host.report.fit_figures import residual_figure
from impid_host.report.page.residual_plots import load_residual_plots
from impid_host.study.folder import write_study
from impid_host.study.model import Study, Trial
from matplotlib.text import Text

from tests.host.report.small_study import L1, L2, K, study

FORCE_N = np.array([4.0, -3.0])


def pushed(trial: Trial, begin_s: float, duration_s: float = 1.5) -> Trial:
    """The same trial while somebody pushes the end point with half a sine; the drives hold against it."""
    t, (t1, t2) = trial.robot.t, trial.robot.theta.T
    u = (t - begin_s) / duration_s
    shape = np.where((u > 0) & (u < 1), np.sin(np.pi * np.clip(u, 0, 1)), 0.0)
    fx, fy = FORCE_N[:, None] * shape
    more = np.stack(
        [-L1 * np.sin(t1) * fx + L1 * np.cos(t1) * fy, L2 * np.cos(t2) * fx + L2 * np.sin(t2) * fy], axis=1
    )
    return replace(trial, robot=replace(trial.robot, tau=trial.robot.tau + more))


def with_push(where: str, begin_s: float) -> Study:
    plain = study("pushed")
    trials = tuple(pushed(one, begin_s) if one.name == where else one for one in plain.trials)
    return replace(plain, trials=trials)


def examined(own: Study):
    options = Options(chain=default_chain(own))
    fit = fit_study(own, options)
    return fit, find_pushes(own, fit, options)


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(cli, [str(argument) for argument in arguments], catch_exceptions=False)


@pytest.mark.parametrize("seed", range(1, 13, 3))
def test_where_nobody_pushes_nothing_is_said(seed: int) -> None:
    _, pushes = examined(study("quiet", seed=seed))
    assert pushes.found == ()
    assert pushes.loads == ()


def test_a_push_under_load_is_found_and_what_it_did_to_the_stiffness() -> None:
    fit, pushes = examined(with_push("spring_01", 6.3))
    (push,) = pushes.found
    assert push.trial == "spring_01"
    assert push.fitted
    assert push.begin_s <= 6.3
    assert push.end_s >= 7.8
    assert push.end_s - push.begin_s <= 4.0  # blocks of two seconds
    (spoilt,) = fit.loads
    clean = pushes.without(spoilt)
    assert clean is not None
    assert pushes.robot is None  # nobody pushed while it was free
    # Without it the numbers are those of the same trial when nobody pushes, and the intervals as narrow.
    (quiet,) = examined(study("quiet"))[0].loads
    apart = np.abs(clean.K.value - quiet.K.value)
    width = quiet.K.ci95[..., 1] - quiet.K.value
    assert (apart < 3 * width).all()
    assert np.abs(spoilt.K.value - K).max() > 3 * np.abs(clean.K.value - K).max()


def test_a_push_in_free_motion_moves_robot_and_load() -> None:
    fit, pushes = examined(with_push("free_02", 8.0))
    assert {push.trial for push in pushes.found} == {"free_02"}
    assert pushes.robot is not None
    quiet = examined(study("quiet"))[0]
    assert np.allclose(pushes.robot.parameters.value, quiet.robot.parameters.value, rtol=0.02)
    assert pushes.without(fit.loads[0]) is not None


def test_a_push_in_the_held_out_end_moves_no_number() -> None:
    fit, pushes = examined(with_push("spring_01", 13.0))
    (push,) = pushes.found
    assert not push.fitted
    assert pushes.loads == ()
    assert np.allclose(fit.loads[0].K.value, examined(study("quiet"))[0].loads[0].K.value)


def test_the_command_says_it_on_screen_in_json_and_in_the_picture(tmp_path: Path) -> None:
    folder = write_study(with_push("spring_01", 6.3), tmp_path / "pushed")
    result = run("fit", folder, "--json", tmp_path / "fit.json", "--figures", tmp_path / "figures")
    assert result.exit_code == 0
    words = " ".join(result.output.split())
    assert "Stretches unlike the rest of their trial" in words
    assert f"{MARGIN_S:.0f} s around each" in words
    document = json.loads((tmp_path / "fit.json").read_text())
    (event,) = document["events"]
    assert event["trial"] == "spring_01"
    assert event["in_fit"] is True
    assert event["power_ratio"] > 5
    load = document["loads"]["spring"]["method1"]
    clean = np.array(load["without_events"]["K"]["value"])
    assert np.abs(clean - K).max() < np.abs(np.array(load["K"]["value"]) - K).max()
    assert (tmp_path / "figures" / "residual_spring.png").exists()
    assert (tmp_path / "figures" / "residual_robot.png").exists()


def test_the_picture_shows_the_whole_trial_and_marks_the_push() -> None:
    fit, pushes = examined(with_push("spring_01", 6.3))
    plots = load_residual_plots(fit.loads[0], pushes)
    figure = residual_figure(plots)
    for strip, plot in zip(figure.axes, plots, strict=True):
        begin, end = strip.get_xlim()
        assert begin < 1.5
        assert end > 13.5  # of 15 s, less the filters' edges
        assert [span.kind for span in plot.spans] == ["held out", "event"]
    assert {text.get_text() for text in figure.findobj(Text)} >= {"event", "held out"}


def test_the_page_has_the_same_tables_and_marks(tmp_path: Path) -> None:
    folder = write_study(with_push("spring_01", 6.3), tmp_path / "pushed")
    out = tmp_path / "report.html"
    assert run("report", folder, "--no-diagnose", "--out", out).exit_code == 0
    page = out.read_text(encoding="utf-8")
    assert "what these stretches moved" in page
    assert "event: in the fit" in page
