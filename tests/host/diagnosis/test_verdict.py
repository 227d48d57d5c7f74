"""The opening sentence, of answers written by hand."""

import numpy as np
import pytest
from impid_host.diagnosis.result import UNATTRIBUTED, Evidence, Finding, Number, Stage, Structure, Tie
from impid_host.diagnosis.verdict import sentence

NOTHING = np.zeros((0, 2))


def number(value, unit: str) -> Number:
    own = np.array(value, dtype=float)
    return Number(own, np.stack([own - 0.01, own + 0.01], axis=-1), unit)


def stage(rms: float, K: float, name: str | None = None, confidence: float = 0.95) -> Stage:
    added = None
    if name is not None:
        added = Finding(name, ("joint1",), (), {}, Evidence(0.6, 90.0, 9.0, confidence))
    load = {"K": number([[K, 20.0], [20.0, 300.0]], "N/m"), "M": number([[1.0, 0.0], [0.0, 1.0]], "kg")}
    rows = {"tau1": rms, "fx": 0.5}
    return Stage(added, rows, {"tau1": 99.0, "fx": 99.0}, number([0.07], "SI"), ("a",), {"spring_A": load})


def said(stages, *, floor=None, ties=(), structure=(), above=False, widened=False) -> str:
    level = {"tau1": 0.006, "fx": 0.4} if floor is None else floor
    return sentence(stages, level, ties, structure, above, units={"fx": "N"}, widened=widened)


def test_a_cause_with_its_certainty_and_what_it_does_to_the_arm() -> None:
    words = said([stage(0.031, 462.0), stage(0.0061, 421.0, "friction.coulomb")])
    assert words.startswith("of 0.031 N*m unexplained in tau1 on data not used, 0.0061 is left")
    assert "the noise floor being 0.006" in words
    assert "cause: friction.coulomb on joint1, sure (0.95)" in words
    assert "K_xx of spring_A goes from 462 to 421 N/m" in words


@pytest.mark.parametrize(("confidence", "word"), [(0.95, "sure"), (0.8, "likely"), (0.5, "possible")])
def test_certainty_has_a_word(confidence: float, word: str) -> None:
    words = said([stage(0.03, 400.0), stage(0.01, 400.0, "friction.coulomb", confidence)])
    assert f"{word} ({confidence:.2f})" in words
    assert "goes from" not in words


def test_a_complete_model_is_said_to_be_complete() -> None:
    assert said([stage(0.0061, 400.0)]).startswith("nothing is missing: ")


def test_without_a_floor_nothing_is_promised() -> None:
    words = said([stage(0.0061, 400.0)], floor={"tau1": None, "fx": None}, above=None)
    assert words.startswith("no effect was found") and "nothing tells the noise floor" in words


def test_more_than_noise_is_not_called_complete() -> None:
    assert said([stage(0.02, 400.0)], above=True).startswith("more than noise is left")


def test_a_tie_blames_nobody() -> None:
    alpha = number([0.07], "SI")
    tie = Tie(
        ("force.scale@x+y", "actuator.gain@joint1+joint2"),
        "a weighed payload",
        {"a": (alpha, {}), "b": (alpha, {})},
    )
    words = said([stage(0.03, 400.0), stage(0.01, 410.0, UNATTRIBUTED)], ties=[tie])
    assert "these data cannot tell force.scale@x+y from actuator.gain@joint1+joint2" in words
    assert "cause" not in words


def test_what_has_no_cause_has_a_shape_and_widens() -> None:
    left = Structure("theta1", "tau1", 0.4, NOTHING, NOTHING, "narrow bump of tau1 near theta1 = 0.8")
    words = said(
        [stage(0.03, 400.0), stage(0.01, 400.0, UNATTRIBUTED)], structure=[left], above=True, widened=True
    )
    assert "without a known cause: narrow bump of tau1 near theta1 = 0.8" in words
    assert "the intervals are widened by what is left unexplained" in words
    assert "cause: " not in words.replace("without a known cause: ", "")


def test_it_is_one_sentence() -> None:
    words = said([stage(0.031, 462.0), stage(0.0061, 421.0, "friction.coulomb")])
    assert "\n" not in words and not words.endswith(".")


def test_a_force_is_in_newtons() -> None:
    only = Stage(None, {"fx": 0.5}, {"fx": 99.0}, number([0.07], "SI"), ("a",), {})
    assert "0.5 N are left in fx" in sentence([only], {"fx": 0.4}, (), (), False, units={}, widened=False)
