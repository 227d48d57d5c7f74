"""Residuals to look at: a step of torque that one stage has not and the next has, along a known motion."""

from dataclasses import replace

import numpy as np
import pytest
from impid_host.diagnosis.base import base_of, structure_named
from impid_host.diagnosis.case import Case as Prepared
from impid_host.diagnosis.holdout import hold_out
from impid_host.diagnosis.prepare import setting_of, views
from impid_host.diagnosis.refit import Refit
from impid_host.diagnosis.result import Chosen, Trace
from impid_host.diagnosis.stages import Bench
from impid_host.diagnosis.traces import traces
from impid_host.effects.catalogue import terms
from impid_host.robot.model import robot_model

from .machines import Case, build, motion, on_joint

OFFSET_N = 6.0
NOISE_N = 100 * 0.002  # as the machine's slide has it


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], Trace]:
    case = Case(
        "slide-1d",
        seed=14,
        free=1,
        loaded=1,
        device=False,
        seconds=16.0,
        noise=NOISE_N / 100,
        torque=[on_joint(0, lambda q, _w: np.full_like(q, OFFSET_N))],
    )
    study = build(case, tmp_path_factory.mktemp("slide"))
    model = robot_model(study.setup.robot)
    parts, _ = views(study, model)
    base = base_of(parts, structure_named("papers", model))
    setting = setting_of(parts, base, referenced=False)
    own = next(t for t in terms(setting) if t.effect == "actuator.offset" and t.when == "all")
    known = Chosen(own, 0.0, np.array([OFFSET_N]), np.zeros((1, 1)))
    bench = Bench(Prepared(tuple(parts), base, hold_out(parts), setting, None, ()), {}, 0.0, None)
    first = Refit(tuple(parts), (), np.zeros((0, 0)), np.zeros(base.size), 0.0)
    last = replace(first, chosen=(known,))
    return {(own.channel, own.trial): own for own in traces(bench, first, last)}


def test_free_and_loaded_trials_have_a_trace_each(shown: dict[tuple[str, str], Trace]) -> None:
    assert set(shown) == {("tau1", "free_01"), ("fx", "spring_A_01")}


def test_before_it_is_named_the_offset_is_the_residual_and_then_only_noise(
    shown: dict[tuple[str, str], Trace],
) -> None:
    own = shown["tau1", "free_01"]
    assert np.mean(own.before) == pytest.approx(OFFSET_N, rel=0.02)
    assert np.std(own.before) < 0.1 * OFFSET_N
    assert abs(np.mean(own.after)) < 0.05
    # White noise of a log at 1 kHz through a low-pass at 4.5 Hz keeps some 4.5 / 500 of its power.
    assert np.std(own.after) == pytest.approx(NOISE_N * np.sqrt(4.5 / 500), rel=0.5)


def test_the_motion_beside_it_is_the_true_one(shown: dict[tuple[str, str], Trace]) -> None:
    own = shown["tau1", "free_01"]
    # The machine's own sinusoids, from its seed; the log begins at 0.05 s.
    true = motion(np.random.default_rng([14, 5]), np.zeros(1), np.array([0.2]))(own.t + 0.05)
    assert own.motion["theta1"] == pytest.approx(true.q[:, 0], abs=1e-4)
    assert own.motion["omega1"] == pytest.approx(true.w[:, 0], abs=2e-3)
    assert own.motion["acceleration"] == pytest.approx(true.a[:, 0], abs=5e-2)
    assert np.array_equal(own.motion["direction"], np.sign(own.motion["omega1"]))
    torque = 12.0 * true.a[:, 0] + 30.0 * true.w[:, 0] + OFFSET_N
    assert own.motion["torque"] == pytest.approx(torque, abs=6 * NOISE_N + 0.5)
    # About 100 Hz of the views' 250: every second row.
    assert np.diff(own.t) == pytest.approx(0.008, abs=1e-6)


def test_held_out_is_the_last_third(shown: dict[tuple[str, str], Trace]) -> None:
    own = shown["tau1", "free_01"]
    assert own.held_out.any()
    begin = own.t[own.held_out].min()
    assert begin == pytest.approx(2 / 3 * (16.0 - 0.05), abs=0.05)
    assert not own.held_out[own.t < begin].any()
