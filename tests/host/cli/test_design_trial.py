"""`impid-host design trial` on a simulated laboratory whose tie is known from the physics."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from impid_host.cli import cli
from impid_host.errors import InputError, UndeterminedError

from hil_sim.scenarios.random import Size, random_scenario
from hil_sim.study.write import write_study

GAIN_OR_SCALE = ["actuator.gain@joint1+joint2", "force.scale@x+y"]
SPRING_AND_OFFSET = ["elastic.joint@joint1", "actuator.offset@joint1"]


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The force sensor reads 5 % high, and nobody weighed the payload."""
    place = tmp_path_factory.mktemp("ties") / "study"
    size = Size(free=1, loads=1, per_load=1, duration_s=20.0)
    scenario, _ = random_scenario(77, size, ("force.scale@sensor,gain=1.05",), 1.0)
    write_study(scenario, place, 77)
    return place


def asked(study: Path, *ties: list[str], name: str = "study") -> Result:
    content = {
        "format": "impid-diagnosis/1",
        "study": name,
        "stages": [{"added": None}],
        "ambiguous": [{"candidates": tie} for tie in ties],
    }
    file = study.parent / "diagnosis.json"
    file.write_text(json.dumps(content))
    arguments = ["design", "trial", str(study), "--for", str(file), "--out", str(study.parent / "next")]
    return CliRunner().invoke(cli, [*arguments, "--payload", "1", "--json", str(study.parent / "t.json")])


def test_a_weighed_payload_tells_a_drive_from_a_sensor_by_as_much_as_its_scales_allow(study: Path) -> None:
    result = asked(study, GAIN_OR_SCALE, SPRING_AND_OFFSET)
    assert result.exit_code == 0, result.output
    told = json.loads((study.parent / "t.json").read_text())
    nats = {row["words"]: row["nats"] for row in told["trials"]}
    # A gain of 5 % makes a mass of 1 kg 50 g wrong; it is weighed to 2 g, and no fit is better than 0.5 %.
    most = 0.5 * (0.05 / np.hypot(0.002, 0.005)) ** 2
    (hung,) = [own for words, own in nats.items() if "weighed payload of 1 kg" in words]
    assert 0.6 * most < hung[0] < 1.2 * most
    free = [own[0] for words, own in nats.items() if "free trial" in words]
    assert free
    assert max(free) < 1.0
    # A spring's rest is an offset: no trial tells whether one stands beside it.
    assert all(own[1] == 0.0 for own in nats.values())
    assert "are the same by their equations" in " ".join(result.output.split())
    assert "the torque at rest with the spring taken off" in " ".join(result.output.split())


def test_what_is_written_is_what_the_words_say(study: Path) -> None:
    result = asked(study, GAIN_OR_SCALE)
    assert result.exit_code == 0, result.output
    best = json.loads((study.parent / "t.json").read_text())["trials"][0]
    assert best["words"] in " ".join(result.output.split())
    if best["folder"] is None:
        assert best["weigh"] == ["spring_L1"]
        return
    head = tomllib.loads((study.parent / "next" / "trial.toml").read_text())
    assert head["payload_kg"] == best["payload_kg"] == 1.0
    table = np.genfromtxt(study.parent / "next" / "reference.csv", delimiter=",", names=True)
    assert table["t"][-1] == pytest.approx(20.0, abs=0.1)
    assert best["folder"] < "free_01"  # the last trial of a kind may be sealed


def test_a_tie_that_no_trial_tells_is_refused(study: Path) -> None:
    result = asked(study, SPRING_AND_OFFSET)
    assert isinstance(result.exception, UndeterminedError)
    assert "none is written" in str(result.exception)


@pytest.mark.parametrize(
    ("tie", "name", "words"),
    [(GAIN_OR_SCALE, "other", "is of the study other"), (["no.such@thing", "x@y"], "study", "no.such@thing")],
)
def test_a_diagnosis_of_something_else_is_refused(study: Path, tie: list[str], name: str, words: str) -> None:
    result = asked(study, tie, name=name)
    assert isinstance(result.exception, InputError)
    assert words in str(result.exception)
