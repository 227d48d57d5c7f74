"""What the page is told of the force: means by hand, looks as they come, bounds."""

import numpy as np
import pytest
from impid_host.view.force_shown import ForceShown

FIRST_US = 5_000_000


def rows(t: np.ndarray, force: np.ndarray) -> dict[str, object]:
    return {"kind": "force", "board_s": (5.0 + t).tolist(), "force": force.tolist()}


def test_points_are_means_over_a_hundredth_whatever_the_pieces() -> None:
    shown = ForceShown()
    t = np.arange(0.0005, 0.1, 1e-3)
    force = np.stack([np.arange(100.0), -np.arange(100.0)], axis=1)
    for begin, end in ((0, 7), (7, 33), (33, 100)):
        shown.take(rows(t[begin:end], force[begin:end]), FIRST_US)
    state = shown.state(0)
    # The last hundredth is not over.
    assert state["t"] == pytest.approx(0.005 + 0.01 * np.arange(9))
    assert state["force"][0] == pytest.approx(4.5 + 10 * np.arange(9))
    assert state["force"][1] == pytest.approx(-4.5 - 10 * np.arange(9))
    assert shown.state(0)["t"] == []


def test_what_waits_is_bounded_and_an_axis_more_begins_anew() -> None:
    shown = ForceShown()
    for k in range(40):
        t = k + np.arange(0, 1, 1e-2)
        shown.take(rows(t, np.zeros((100, 2))), FIRST_US)
    assert len(shown.state(0)["t"]) == 1000
    shown.take(rows(np.array([50.0, 50.02]), np.ones((2, 1))), FIRST_US)
    assert len(shown.state(0)["force"]) == 1


def test_words_and_looks() -> None:
    shown = ForceShown()
    shown.take({"kind": "observer", "words": "waiting"}, None)
    shown.take({"kind": "stiffness", "board_s": 9.0, "K": [[1.0]]}, FIRST_US)
    shown.take({"kind": "stiffness", "board_s": None, "reason": "too short"}, FIRST_US)
    state = shown.state(3)
    assert state["words"] == "waiting; 3 pieces of samples left out"
    assert [look["t"] for look in state["looks"]] == [4.0, None]
    assert shown.state(0)["looks"] == []
    assert shown.state(0)["words"] == "waiting"
