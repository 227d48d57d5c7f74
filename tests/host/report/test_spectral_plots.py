"""The figures' content, read back from the drawn lines."""

import numpy as np
import pytest
from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.agreement import Agreement
from impid_host.impedance.spectral.estimate import TrialSignals, estimate_spectral
from impid_host.impedance.spectral.welch import WelchSetting
from impid_host.report.spectral_plots import (
    agreement_figure,
    coherence_figure,
    ellipse_figure,
    impedance_figure,
)

SETTING = WelchSetting(1024, 1024, 512)


@pytest.fixture(scope="module")
def estimates():
    rng = np.random.default_rng(1)
    trials = []
    for _ in range(2):
        F = rng.standard_normal((8000, 2))
        trials.append(
            estimate_spectral([TrialSignals(F, F @ np.array([[1.0, 0.3], [0.3, 2.0]]))], 500.0, SETTING)
        )
    return trials


def test_impedance_lines_are_the_mean_over_the_trials(estimates, tmp_path):
    model = (np.eye(2), np.eye(2), np.diag([1.0, 2.0]))
    figure = impedance_figure({"16 segments": estimates}, model, "load")
    Z = (estimates[0].best.Z + estimates[1].best.Z) / 2
    line = figure.axes[1].lines[0]
    np.testing.assert_allclose(np.asarray(line.get_ydata()), 20 * np.log10(np.abs(Z[:, 0, 1])))
    np.testing.assert_allclose(np.asarray(line.get_xdata()), estimates[0].frequency_Hz[estimates[0].band])
    # the model has no coupling, so its panel shows the estimate alone
    assert [len(panel.lines) for panel in figure.axes] == [2, 1, 2, 1, 1, 2, 1, 2]
    figure.savefig(tmp_path / "f.png")


def test_coherence_panels_hold_partial_and_multiple_coherence(estimates, tmp_path):
    figure = coherence_figure({"16 segments": estimates})
    band = estimates[0].band
    partial = np.mean([e.best.partial_coherence[band] for e in estimates], axis=0)
    multiple = np.mean([e.best.multiple_coherence[band] for e in estimates], axis=0)
    np.testing.assert_allclose(np.asarray(figure.axes[2].lines[0].get_ydata()), partial[:, 1, 0])
    np.testing.assert_allclose(np.asarray(figure.axes[5].lines[0].get_ydata()), multiple[:, 1])
    figure.savefig(tmp_path / "f.png")


def test_every_trial_has_its_mark(tmp_path):
    low, high = (
        Agreement(np.array([[99.0, 98.0], [97.0, v]]), 0.9, u) for v, u in ((90.0, 5.0), (91.0, 10.0))
    )
    results = {"5 segments": {"sa1": [(low, high)] * 6, "sa2": [(low, high)] * 6}}
    figure = agreement_figure(results)
    yy = figure.axes[3].lines
    assert len(yy) == 4
    assert all(len(np.asarray(line.get_ydata())) == 6 for line in yy)
    assert {float(np.asarray(line.get_ydata())[0]) for line in yy} == {90.0, 91.0}
    figure.savefig(tmp_path / "f.png")


def test_ellipse_has_the_stiffness_s_axes(tmp_path):
    figure = ellipse_figure({"a": np.diag([700.0, 300.0]), "b": 300 * np.eye(2)})
    x, y = figure.axes[0].lines[0].get_data()
    assert np.max(np.abs(x)) == pytest.approx(700.0)
    assert np.max(np.abs(y)) == pytest.approx(300.0)
    figure.savefig(tmp_path / "f.png")


def test_figures_for_two_axes_refuse_anything_else(estimates):
    with pytest.raises(UndeterminedError, match="no trials"):
        impedance_figure({"none": []})
    F = np.random.default_rng(2).standard_normal((8000, 1))
    one = estimate_spectral([TrialSignals(F, F)], 500.0, SETTING)
    with pytest.raises(UndeterminedError, match="two axes"):
        impedance_figure({"one": [one]})
