"""Impedance over time, a column and a cue: curves known in closed form are held by their bands."""

import json
from pathlib import Path

import impid_host
import numpy as np
import pytest
from click.testing import CliRunner
from impid_host.cli import cli
from impid_host.errors import InputError, UndeterminedError
from impid_host.front import of_model
from impid_host.impedance.varying.bands import band
from impid_host.impedance.varying.curves import Knots
from impid_host.impedance.varying.posterior import Evidence, Group, Layout, Normal
from impid_host.impedance.varying.schedule import since
from impid_host.study.folder import read_study, write_study

from .varying_study import by_activity, course, rising, still, with_cues


@pytest.fixture(scope="module")
def risen() -> impid_host.Varied:
    return of_model(rising()).fit_varying()


def test_a_joint_that_stiffens_is_followed(risen: impid_host.Varied) -> None:
    (fit,) = risen.result
    true = course(np.linspace(0, 40 - 1 / 200, 8000))
    own = fit.curves["K"]
    at = np.interp(fit.places, np.linspace(0, 40 - 1 / 200, 8000), true)
    assert np.all((own.low <= at) & (at <= own.high))
    assert np.max(own.high - own.low) < 12.0  # of a rise of 30
    assert np.mean(own.high - own.low) < 5.0
    assert risen.changes == {"joint_01": ("K",)}
    assert fit.M["I"].low[0] <= 0.05 <= fit.M["I"].high[0]
    assert fit.curves["theta0"].low.max() <= 0.1 <= fit.curves["theta0"].high.min()
    assert fit.vaf_varying[0] > fit.vaf_constant[0] + 1.0
    assert fit.vaf_varying[0] > 99.5


def test_what_it_says(risen: impid_host.Varied) -> None:
    words = risen.summary()
    assert "K changes" in words
    assert "B may be constant" in words
    assert "load.time_varying@load" in words
    table = risen.to_pandas()
    assert set(table["curve"]) == {"K", "B", "theta0"}
    assert len(table) == 3 * 101


def test_joints_that_hold_still_are_not_said_to_change() -> None:
    for seed in range(6):
        varied = of_model(still(seed)).fit_varying()
        assert varied.changes == {"joint_01": ()}
        (fit,) = varied.result
        assert np.all((fit.curves["K"].low <= 65.0) & (fit.curves["K"].high >= 65.0))


def test_muscle_activity_in_a_column(tmp_path: Path) -> None:
    write_study(by_activity(), tmp_path / "study")
    study = impid_host.Study.load(tmp_path / "study", columns=("emg",))
    (fit,) = study.fit_varying("emg").result
    true = 40.0 + 50.0 * fit.places
    assert np.all((fit.curves["K"].low <= true) & (true <= fit.curves["K"].high))
    assert fit.claimed == ("K",)
    assert len(fit.trials) == 2


def test_time_since_a_cue() -> None:
    (fit,) = of_model(with_cues()).fit_varying("since:emg").result
    true = 50.0 + 30.0 * np.exp(-((fit.places - 1.5) ** 2))
    assert 4.5 < fit.places[-1] <= 5.0
    assert np.all((fit.curves["K"].low <= true) & (true <= fit.curves["K"].high))
    assert "K" in fit.claimed


def test_a_column_that_is_not_there_is_named(tmp_path: Path) -> None:
    write_study(by_activity(), tmp_path / "study")
    with pytest.raises(InputError, match="no column torque"):
        read_study(tmp_path / "study", ("torque",))
    with pytest.raises(InputError, match="no column other"):
        of_model(by_activity()).fit_varying("other")


def test_a_posture_that_stands_still_is_refused() -> None:
    study = of_model(still(0))
    with pytest.raises(UndeterminedError, match="stands still"):
        study.fit_varying("emg")


def test_a_cue_that_never_comes() -> None:
    with pytest.raises(UndeterminedError, match="never rises"):
        since([np.zeros(10)], list(of_model(still(0)).fit().result.trials), "cue")


def test_the_command(tmp_path: Path) -> None:
    write_study(rising(), tmp_path / "study")
    out = tmp_path / "out.json"
    arguments = [
        "fit",
        str(tmp_path / "study"),
        "--varying",
        "time",
        "--json",
        str(out),
        "--figures",
        str(tmp_path),
    ]
    result = CliRunner().invoke(cli, arguments)
    assert result.exit_code == 0, result.output
    assert "K changes" in result.output
    (entry,) = json.loads(out.read_text(encoding="utf-8"))["varying"]
    assert entry["by"] == "time"
    assert entry["asked"]["K"]["changes"]
    assert entry["effects"] == ["load.time_varying@load"]
    assert len(entry["curves"]["K"]["low"]) == len(entry["places"])
    assert list(tmp_path.glob("varying_*.png"))


def test_the_likelihood_is_that_of_the_whole_covariance() -> None:
    """Against the textbook's restricted likelihood, by determinants of N x N matrices."""
    rng = np.random.default_rng(2)
    knots = Knots(0.0, 1.0, 6)
    layout = Layout(2, (Group("K", (0,), 2.0), Group("x0", (1,), 1.0)), knots)
    s = np.linspace(0, 1, 40)
    X = np.stack([rng.normal(size=40), np.ones(40)], axis=1)
    W = knots.weights(s)
    Z = np.concatenate([X[:, :1] * W, X[:, 1:] * W], axis=1)
    y = rng.normal(size=40)
    full = np.concatenate([X, Z], axis=1)
    evidence = Evidence(Normal(full.T @ full, full.T @ y, float(y @ y), 40), layout)

    def direct(hyper: np.ndarray) -> float:
        prior = np.zeros((12, 12))
        for k in range(2):
            L = layout.groups[k].scale * np.exp(hyper[2 * k]) * knots.root(float(np.exp(hyper[2 * k + 1])))
            prior[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] = L @ L.T
        V = np.eye(40) + Z @ prior @ Z.T
        inverse = np.linalg.inv(V)
        information = X.T @ inverse @ X
        P = inverse - inverse @ X @ np.linalg.inv(information) @ X.T @ inverse
        return float(
            -0.5 * np.linalg.slogdet(V)[1]
            - 0.5 * np.linalg.slogdet(information)[1]
            - 19.0 * np.log(y @ P @ y)
        )

    first, second = np.array([-0.3, -1.0, 0.4, -0.5]), np.array([0.5, -0.2, -1.0, -1.2])
    ours = evidence.log_likelihood(first) - evidence.log_likelihood(second)
    assert ours == pytest.approx(direct(first) - direct(second), abs=1e-6)


def test_a_band_holds_whole_curves() -> None:
    """Of white curves of 20 points each lies within sd z with z the 0.95^(1/20) quantile: 3.02 sd."""
    draws = np.random.default_rng(0).normal(size=(20_000, 20))
    own = band(draws, "")
    assert np.mean(own.high - own.low) / 2 == pytest.approx(3.02, abs=0.06)
