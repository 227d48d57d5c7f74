"""One laboratory, a mistake of each family: named, with the value that mends it; in order, nothing is said.

The whole campaign is bench/mistakes_validation.py (docs/validation/mistakes.md).
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from impid_host.checks import agreement, check_study
from mistakes_campaign.mistakes import MISTAKES

BY_NAME = {mistake.name: mistake for mistake in MISTAKES}
SOME = (
    "both torques' signs",
    "tau1's sign",
    "torques in mN m",
    "torques swapped",
    "counts without x4",
    "encoder 1 backwards",
    "zero of joint 1 off by 0.2",
    "controller in degrees",
    "module counts relative angles",
    "encoder 1 wraps at 16 bits",
    "accelerometer's axes swapped",
    "mount off by 90 degrees",
    "vref 5 for 3.3",
    "accelerometer clipped",
    "links swapped",
    "links 10 % long",
    "force of the robot on the load",
    "force in kgf",
    "force sensor on the end-effector",
    "a free trial among the loads",
    "a load among the free trials",
    "a trial twice",
    "robot's clock in ms",
    "robot's clock jumps an hour",
    "device.csv of another trial",
)


@pytest.mark.parametrize("name", SOME)
def test_named_among_at_most_three(study, name):
    mistake = BY_NAME[name]
    found = check_study(mistake.change(study))
    assert {entry.what for entry in found} & set(mistake.names), [entry.label for entry in found]
    assert len(found) <= 3
    assert not found.trusted
    assert all(entry.remedy for entry in found)


def test_in_order_nothing_is_said(study):
    assert not check_study(study).entries
    assert not agreement(study).checks.entries


def test_the_change_that_is_named_mends_the_study(study):
    for name in ("zero of joint 1 off by 0.2", "mount off by 90 degrees", "links swapped", "vref 5 for 3.3"):
        wrong = BY_NAME[name].change(study)
        (entry,) = check_study(wrong).entries
        tables: dict[str, Any] = {"encoder": wrong.setup.encoder, "accelerometer": wrong.setup.accelerometer}
        tables["robot"] = wrong.setup.robot
        for change in entry.changes:
            value = tuple(change.value) if isinstance(change.value, list) else change.value
            tables[change.table] = replace(tables[change.table], **{change.key: value})
        mended = replace(wrong, setup=replace(wrong.setup, **tables))
        assert not check_study(mended).entries, name
        assert mended.setup.robot.link_lengths_m == pytest.approx(study.setup.robot.link_lengths_m)
        assert mended.setup.encoder.zero_rad == pytest.approx(study.setup.encoder.zero_rad, abs=2e-3)


def test_a_factor_that_nothing_contradicts_is_not_found(study):
    bare = replace(
        study,
        trials=tuple(
            replace(trial, payload_kg=None, robot=replace(trial.robot, force=None)) for trial in study.trials
        ),
    )
    assert not check_study(BY_NAME["torques in kgf m"].change(bare)).entries


def test_a_small_disagreement_is_said_without_a_cause(study):
    tilted = np.diag([1.08, 1.0])
    wrong = replace(
        study,
        trials=tuple(
            replace(t, payload_kg=None, robot=replace(t.robot, force=t.robot.force @ tilted))
            for t in study.trials
        ),
    )
    assert [entry.what for entry in check_study(wrong)] == ["methods.disagree"]


def test_forces_that_come_late_are_told_by_how_much(study):
    late = replace(
        study,
        trials=tuple(
            replace(t, robot=replace(t.robot, force=np.roll(t.robot.force, 20, axis=0))) for t in study.trials
        ),
    )
    step_s = float(np.median(np.diff(study.trials[0].robot.t)))
    found = next(entry for entry in check_study(late) if entry.label == "methods.disagree@sensor")
    assert found.evidence["lag_s"] == pytest.approx(20 * step_s, rel=0.1)
    assert not any(entry.where == "sensor" for entry in check_study(study))


def test_a_stretch_without_forces_is_no_force_of_zero(study):
    def lost(log):
        force = log.force.copy()
        force[len(log) // 2 : len(log) * 2 // 3] = np.nan
        return replace(log, force=force)

    holed = replace(study, trials=tuple(replace(t, robot=lost(t.robot)) for t in study.trials))
    assert not list(check_study(holed))
