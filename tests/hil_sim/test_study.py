"""The study folder: what is in it, what must not be, and that the seed decides every byte."""

import json
import tomllib
from pathlib import Path

import pytest

from hil_sim.errors import SimError
from hil_sim.scenarios.load import load
from hil_sim.study.write import write_study


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_same_seed_same_bytes_other_seed_other_bytes(scenario_file, tmp_path):
    scenario = load(str(scenario_file(1.5)))
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        write_study(scenario, tmp_path / name, seed)
    a, b, c = (files(tmp_path / name) for name in "abc")
    assert a == b
    assert a["setup.toml"] == c["setup.toml"]
    for trial in ("free_01", "spring_K5_M3_01"):
        for name in ("device.csv", "robot.csv"):
            assert a[f"{trial}/{name}"] != c[f"{trial}/{name}"]


def test_the_folder_has_the_form_of_a_study_and_hides_the_truth(scenario_file, tmp_path):
    write_study(load(str(scenario_file(1.5))), tmp_path / "study", 1, tmp_path / "truth.json")
    found = files(tmp_path / "study")
    trials = ["free_01", "free_02", "spring_K1_M1_01", "spring_K5_M3_01"]
    expected = {f"{t}/{n}" for t in trials for n in ("trial.toml", "device.csv", "robot.csv")} | {
        "setup.toml"
    }
    assert set(found) == expected
    setup = tomllib.loads(found["setup.toml"].decode())
    assert set(setup) == {"format", "robot", "encoder", "accelerometer", "handle"}
    assert setup["format"] == "impid-study/1"
    assert tomllib.loads(found["spring_K1_M1_01/trial.toml"].decode()) == {
        "kind": "mass-spring",
        "load": "spring_K1_M1",
    }
    assert found["free_01/device.csv"].startswith(b"t_us,seq,ax,ay,enc1,enc2,flags\n")
    assert found["free_01/robot.csv"].startswith(b"t,theta1,theta2,tau1,tau2,fx,fy\n12.25,")
    assert found["free_01/robot.csv"].count(b"\n") == 1501
    for name, content in found.items():
        if name.endswith(".toml"):
            for secret in (b"0.06929", b"421.57", b"0.539", b"ppm", b"noise"):
                assert secret not in content
    truth = json.loads((tmp_path / "truth.json").read_text())
    assert truth["trials"]["spring_K1_M1_01"]["load"]["K"][0] == [421.57, -18.87]
    assert truth["trials"]["free_01"]["clock"]["drift_ppm"] == pytest.approx(64.0, abs=0.01)


def test_without_a_force_sensor_the_log_has_no_forces(scenario_file, tmp_path):
    scenario = load(str(scenario_file(1.0, lambda content: content["world"].pop("force_sensor"))))
    write_study(scenario, tmp_path / "study", 1)
    assert (tmp_path / "study/free_01/robot.csv").read_text().startswith("t,theta1,theta2,tau1,tau2\n")


def test_an_occupied_folder_is_left_alone(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(SimError, match="not an empty folder"):
        write_study(load("first-light"), tmp_path, 1)
    assert files(tmp_path) == {"mine.txt": b"mine"}


def test_the_truth_may_not_lie_in_the_study(tmp_path):
    with pytest.raises(SimError, match="inside the study"):
        write_study(load("first-light"), tmp_path / "study", 1, tmp_path / "study" / "truth.json")
