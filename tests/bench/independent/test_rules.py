"""The judging rules on reports written by hand."""

from __future__ import annotations

from typing import Any

import pytest
from independent.rules import confidences, coverage, read_report, read_truth, verdict
from independent.table import wilson


def hidden(name, where, near=(), companions=(), instead=(), any_joint=False):
    return {
        "name": name, "where": where, "near": list(near), "with": list(companions), "instead": list(instead),
        "any_joint": any_joint,
    }  # fmt: skip


def said(*names, ties=()):
    stages: list[dict[str, Any]] = [{"added": None}]
    stages += [{"added": {"effect": n, "where": w, "evidence": {"confidence": 0.9}}} for n, w in names]
    return read_report({"stages": stages, "ambiguous": [{"candidates": list(t)} for t in ties]})


COULOMB = hidden("friction.coulomb", ["joint1", "joint2"])
STRIBECK = hidden("friction.stribeck", ["joint2"], companions=["friction.coulomb"])
UNEQUAL = hidden("friction.asymmetric", ["joint1"], instead=[["friction.coulomb", "actuator.offset"]])
ROTOR = hidden("inertia.extra", ["joint1", "joint2"], any_joint=True)
GAIN = hidden("accel.scale", ["x"])
ODD = hidden(None, ["tip"], near=["elastic.cartesian"])


@pytest.mark.parametrize(
    ("effects", "report", "word"),
    [
        ([COULOMB], said(("friction.coulomb", ["joint1", "joint2"])), "right"),
        ([COULOMB], said(("friction.coulomb", "joint1"), ("friction.coulomb", "joint2")), "right"),
        ([COULOMB], said(("friction.coulomb", "joint1")), "partial"),
        ([COULOMB], said(("friction.coulomb", ["joint1", "joint2"]), ("gravity.tilt", "tip")), "too_much"),
        ([COULOMB], said(ties=[["friction.coulomb@joint1+joint2", "friction.stribeck@joint1"]]), "tie"),
        ([COULOMB], said(ties=[["accel.scale@x", "inertia.extra@tip"]]), "wrong_tie"),
        ([COULOMB], said(("actuator.gain", "joint1")), "wrong"),
        ([COULOMB], said(("unattributed", "joint1")), "silent"),
        ([STRIBECK], said(("friction.stribeck", "joint2"), ("friction.coulomb", "joint2")), "right"),
        ([STRIBECK], said(("friction.stribeck", "joint2"), ("friction.coulomb", "joint1")), "too_much"),
        ([STRIBECK], said(("friction.stribeck", ["joint1", "joint2"])), "too_much"),
        ([UNEQUAL], said(("friction.coulomb", "joint1"), ("actuator.offset", "joint1")), "right"),
        ([UNEQUAL], said(("friction.coulomb", "joint1")), "partial"),
        ([ROTOR], said(("inertia.extra", "joint2")), "right"),
        ([GAIN], said(("accel.scale", ["x", "y"])), "right"),
        ([GAIN], said(("accel.scale", "y")), "wrong"),
        ([GAIN], said(("accel.scale", "sensor")), "right"),
        (
            [GAIN, STRIBECK],
            said(("accel.scale", "x"), ties=[["friction.stribeck@joint2", "elastic.joint@joint2"]]),
            "tie",
        ),
        ([ODD], said(), "honest"),
        ([ODD], said(("elastic.cartesian", "tip")), "near"),
        ([ODD], said(("gravity.tilt", "tip")), "pinned"),
        ([ODD], said(ties=[["gravity.tilt@tip", "accel.bias@x"]]), "tied"),
        ([ODD, GAIN], said(("accel.scale", "x")), "honest"),
        ([], said(), "quiet"),
        ([], said(("gravity.tilt", "tip")), "false_alarm"),
        ([], said(ties=[["gravity.tilt@tip", "accel.bias@x"]]), "false_alarm"),
    ],
)
def test_verdicts(effects, report, word):
    assert verdict(read_truth({"effects": effects}), report) == word


def test_a_name_within_a_tie_was_not_chosen():
    report = said(("accel.scale", "x"), ties=[["accel.scale@x", "inertia.extra@tip"]])
    assert report.named == ()


def test_confidence_counts_once_for_each_name():
    truth = read_truth({"effects": [GAIN]})
    assert confidences(truth, said(("accel.scale", "x"), ("gravity.tilt", "tip"))) == [
        (0.9, True),
        (0.9, False),
    ]


@pytest.mark.parametrize("pairs_last", [True, False])
def test_coverage_counts_each_entry(pairs_last):
    low, high = [[90, -5], [1, 40]], [[110, 5], [9, 60]]
    ends = [[[low[i][j], high[i][j]] for j in range(2)] for i in range(2)] if pairs_last else [low, high]
    truth = {"K_defined": True, "loads": {"s": {"K": [[100, 0], [0, 50]]}}}
    report = {"stages": [{"parameters": {"loads": {"s": {"K": {"value": 0, "ci95": ends}}}}}]}
    assert [k[3] for k in coverage(truth, report)] == [True, True, False, True]


def test_wilson_interval_of_the_textbook():
    """Newcombe 1998, table I: 81 of 263 gives 0.2553 to 0.3662, 0 of 20 gives 0 to 0.1611."""
    assert wilson(81, 263) == pytest.approx((0.2553, 0.3662), abs=1e-4)
    assert wilson(0, 20) == pytest.approx((0.0, 0.1611), abs=1e-4)
