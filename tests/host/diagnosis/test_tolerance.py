"""A length's tolerance in K's interval, against whole fits with the length declared otherwise."""

from dataclasses import replace

import numpy as np
import pytest
from impid_host.diagnosis.base import Base, base_of, structure_of
from impid_host.diagnosis.holdout import Holdout, hold_out
from impid_host.diagnosis.prepare import views
from impid_host.diagnosis.proof import fitted
from impid_host.diagnosis.refit import Refit
from impid_host.diagnosis.result import Number, Stage
from impid_host.diagnosis.tolerance import LENGTHS, NOISE, in_words, with_tolerance
from impid_host.effects.view import View
from impid_host.robot.model import robot_model
from impid_host.study.model import Study, Tolerance

from .machines import L1, L2, Case, build

SD_M = 0.002
ALPHA = Number(np.zeros(1), np.zeros((1, 2)), "")


def prepared(study: Study) -> tuple[list[View], Base, Holdout]:
    model = robot_model(study.setup.robot)
    parts, _ = views(study, model)
    return parts, base_of(parts, structure_of(study.setup, model)), hold_out(parts)


def declared(study: Study, lengths: tuple[float, float]) -> Study:
    robot = replace(study.setup.robot, link_lengths_m=lengths)
    return replace(study, setup=replace(study.setup, robot=robot))


def stiffness(study: Study, lengths: tuple[float, float]) -> dict[str, np.ndarray]:
    """K of each load by plain least squares, with the links as declared."""
    parts, base, holdout = prepared(declared(study, lengths))
    fit = fitted(parts, [], base, holdout, None, ar_order=0)
    result = {}
    for name, load in fit.loads.items():
        at = dict(zip(load.names, load.value, strict=True))
        result[name] = np.array([[at["kxx"], at["ks"]], [at["ks"], at["kyy"]]])
    return result


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    case = Case("planar-2r-relative", seed=171, free=1, loaded=1, device=False, seconds=15.0)
    return build(case, tmp_path_factory.mktemp("arm"))


def stage(study: Study, half: float) -> tuple[Stage, Stage]:
    """Before and after, with an interval by noise of `half` on every entry of K."""
    parts, base, holdout = prepared(study)
    own = {}
    for name, K in stiffness(study, (L1, L2)).items():
        own[name] = {"K": Number(K, np.stack([K - half, K + half], axis=-1), "N/m")}
    plain = Stage(None, {}, {}, ALPHA, (), own)
    none = Refit(tuple(parts), (), np.zeros((0, 0)), np.zeros(base.size), 0.0)
    return plain, with_tolerance(plain, none, base, holdout, None, Tolerance(link_lengths_m=SD_M))


def test_the_interval_is_that_of_two_fits_with_longer_links(study: Study) -> None:
    plain, wide = stage(study, 2.0)
    here = stiffness(study, (L1, L2))
    longer = [stiffness(study, lengths) for lengths in ((L1 + SD_M, L2), (L1, L2 + SD_M))]
    for name, K in here.items():
        by_lengths = 1.96 * np.sqrt(sum((other[name] - K) ** 2 for other in longer))
        # A per cent of 0.3 m squared in K of 300: it must show beside the noise.
        assert by_lengths.max() > 3.0
        assert wide.parts[name]["K"][LENGTHS] == pytest.approx(by_lengths, rel=1e-3, abs=1e-6)
        assert wide.parts[name]["K"][NOISE] == pytest.approx(np.full((2, 2), 2.0))
        assert wide.loads[name]["K"].half == pytest.approx(np.hypot(2.0, by_lengths), rel=1e-3)
        assert wide.loads[name]["K"].value == pytest.approx(plain.loads[name]["K"].value)
        assert wide.loads[name]["K"].ci95.mean(axis=-1) == pytest.approx(K)


def test_a_reader_is_told_what_the_interval_is_owed_to(study: Study) -> None:
    _, wide = stage(study, 2.0)
    (line,) = in_words(wide)
    ((name, own),) = wide.parts.items()
    largest = np.abs(wide.loads[name]["K"].value).max()
    whole, noise, lengths = (
        f"{100 * float(np.max(part)) / largest:.2g} %"
        for part in (wide.loads[name]["K"].half, own["K"][NOISE], own["K"][LENGTHS])
    )
    assert line == f"K's interval of {whole} in {name}: {noise} by noise, {lengths} by link lengths"


def test_lengths_that_are_exact_add_nothing(study: Study) -> None:
    parts, base, holdout = prepared(study)
    plain, _ = stage(study, 2.0)
    none = Refit(tuple(parts), (), np.zeros((0, 0)), np.zeros(base.size), 0.0)
    assert with_tolerance(plain, none, base, holdout, None, Tolerance(link_lengths_m=0.0)) is plain
