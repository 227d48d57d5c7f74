"""What a stage reports with an effect taken out is what a study without the effect reports."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from impid_host.diagnosis.base import base_of, structure_of
from impid_host.diagnosis.holdout import hold_out
from impid_host.diagnosis.prepare import setting_of, views
from impid_host.diagnosis.proof import StageFit, fitted
from impid_host.diagnosis.result import Chosen
from impid_host.effects.catalogue import terms
from impid_host.robot.model import robot_model
from impid_host.study.model import Study

from .machines import L1, L2, Case, build, truth

LONGER_M = np.array([0.012, -0.009])


def as_declared(study: Study, *, undone: bool) -> StageFit:
    """Robot and loads with the links as setup.toml has them, or with what they lack put right."""
    model = robot_model(study.setup.robot)
    parts, _ = views(study, model)
    base = base_of(parts, structure_of(study.setup, model))
    setting = setting_of(parts, base, referenced=False)
    term = next(t for t in terms(setting) if t.effect == "geometry.link_length" and t.size == 2)
    chosen = [Chosen(term, 0.0, LONGER_M, np.eye(2))] if undone else []
    return fitted(parts, chosen, base, hold_out(parts), None)


def declared_wrongly(study: Study) -> Study:
    lengths = (L1 - LONGER_M[0], L2 - LONGER_M[1])
    return replace(
        study, setup=replace(study.setup, robot=replace(study.setup.robot, link_lengths_m=lengths))
    )


@pytest.mark.parametrize(
    "case",
    [
        Case("planar-2r-relative", (0.0, -9.81), seed=130, free=1, loaded=1, device=False, seconds=20.0),
        Case("planar-2r-relative", seed=131, free=0, loaded=1, device=False, force_sensor=True, seconds=20.0),
    ],
    ids=["free trial", "force sensor"],
)
def test_links_put_right_reach_robot_load_and_virtual_force(case: Case, tmp_path: Path) -> None:
    study = build(case, tmp_path)
    right, wrong = as_declared(study, undone=False), as_declared(declared_wrongly(study), undone=False)
    mended = as_declared(declared_wrongly(study), undone=True)
    (load,) = right.loads
    assert mended.robot.value == pytest.approx(right.robot.value, rel=1e-6, abs=1e-9)
    assert mended.loads[load].value == pytest.approx(right.loads[load].value, rel=1e-6, abs=1e-9)
    for one, other in zip(mended.virtual[load], right.virtual[load], strict=True):
        assert one[1].target == pytest.approx(other[1].target, abs=1e-9)
    K = truth(case, 0)["K"][0, 0]
    place = right.loads[load].names.index("kxx")
    assert right.loads[load].value[place] == pytest.approx(K, rel=0.01)
    assert abs(wrong.loads[load].value[place] - K) > 0.02 * K
