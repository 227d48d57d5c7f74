"""One rotary joint, one linear drive: what they log is one equation, and there is no board."""

import numpy as np
import pyarrow.csv
import pytest
from pydantic import ValidationError
from scipy.signal import butter, sosfiltfilt

from hil_sim.errors import SimError
from hil_sim.scenarios.load import load
from hil_sim.scenarios.schema import Scenario, TorqueLogTable
from hil_sim.study.write import write_study
from hil_sim.trials import trial_truth


def written(name, out):
    """The study of ten seconds of each trial, with a torque log that is exact."""
    scenario = load(name)
    trials = tuple(trial.model_copy(update={"duration_s": 10.0}) for trial in scenario.trials)
    world = scenario.world.model_copy(update={"torque_log": TorqueLogTable()})
    scenario = scenario.model_copy(update={"trials": trials, "world": world})
    write_study(scenario, out, 1)
    return scenario


def rows(path):
    """Angle, speed, acceleration and torque below 8 Hz, on the drive's own clock."""
    table = pyarrow.csv.read_csv(path)
    assert len(table.column_names) == 3
    low = butter(4, 8.0, fs=1000.0, output="sos")
    q = table["theta1"].to_numpy()
    w = np.gradient(q, 1e-3)
    columns = (q, w, np.gradient(w, 1e-3), table["tau1"].to_numpy())
    return [sosfiltfilt(low, column)[1500:-1500] for column in columns]


def test_a_joint_in_a_vertical_plane_follows_its_equation(tmp_path):
    written("pendulum", tmp_path / "study")
    assert (tmp_path / "study/setup.toml").read_text().count("[") == 1
    assert not list((tmp_path / "study").glob("*/device.csv"))
    q, w, a, tau = rows(tmp_path / "study/free_01/robot.csv")
    assert tau == pytest.approx(0.012 * a + 0.02 * w + 0.4 * np.sin(q) + 0.1 * np.cos(q), abs=5e-3)
    q, w, a, tau = rows(tmp_path / "study/limb_01/robot.csv")
    law = 0.032 * a + 0.32 * w + 6.0 * (q - 0.2) + 0.4 * np.sin(q) + 0.1 * np.cos(q)
    assert tau == pytest.approx(law, abs=1e-2)
    assert np.std(tau) > 0.2


def test_a_linear_drive_moves_its_mass(tmp_path):
    scenario = written("slide", tmp_path / "study")
    assert 'model = "slide-1d"' in (tmp_path / "study/setup.toml").read_text()
    q, w, a, tau = rows(tmp_path / "study/free_01/robot.csv")
    assert 0.05 < np.ptp(q) < 0.15
    rubs = tau - 2.5 * a - 8.0 * w
    steady = abs(w) > 0.1
    assert np.median(rubs[steady] * np.sign(w[steady])) == pytest.approx(0.8, abs=0.03)
    assert trial_truth(scenario, scenario.trials[0], 1).plant.alpha[0] == 2.5


def changed(name, change):
    content = load(name).model_dump(exclude_unset=True)
    change(content)
    return Scenario.model_validate(content)


def test_a_single_axis_has_no_lengths_and_two_links_have():
    with pytest.raises(ValidationError, match="link_lengths_m does not go with joint-1d"):
        changed("pendulum", lambda one: one["setup"]["robot"].update(link_lengths_m=(0.2, 0.3)))
    with pytest.raises(ValidationError, match="add the lengths of both links"):
        changed("first-light", lambda one: one["setup"]["robot"].pop("link_lengths_m"))


def test_an_effect_of_the_second_joint_is_refused():
    effect = {"effect": "friction.coulomb", "where": "joint2", "torque": 0.1}
    scenario = changed("pendulum", lambda one: one.update(effects=[effect]))
    with pytest.raises(SimError, match="joint-1d has joint1 alone"):
        trial_truth(scenario, scenario.trials[0], 1)
