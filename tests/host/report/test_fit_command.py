"""`impid-host fit` and `sync` as a user calls them."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from impid_host.cli import cli
from impid_host.errors import ImpidError
from impid_host.samples import DeviceSamples
from impid_host.study.folder import write_study
from impid_host.study.model import (
    AccelerometerSetup,
    EncoderSetup,
    RobotLog,
    RobotSetup,
    Setup,
    Study,
    Trial,
)

CHECKOUT = Path(__file__).resolve().parents[3]
ALPHA = np.array([0.06929, 0.04217, 0.04416, 0.06510, 0.07389])
L1, L2 = 0.254, 0.2667


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(cli, [str(argument) for argument in arguments], catch_exceptions=False)


def free_trial(name: str, seed: int) -> Trial:
    """12 s of a motion in closed form with the torque that eqs. 1 and 11 to 13 of [D] ask for."""
    rng = np.random.default_rng(seed)
    angular = 2 * np.pi * rng.uniform(0.2, 2.0, (2, 6, 1))
    phase = rng.uniform(0, 2 * np.pi, (2, 6, 1))

    def motion(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        theta = 0.7 + 0.06 * np.sin(angular * t + phase).sum(axis=1)
        omega = 0.06 * (angular * np.cos(angular * t + phase)).sum(axis=1)
        return theta, omega, -0.06 * (angular**2 * np.sin(angular * t + phase)).sum(axis=1)

    t = np.arange(0, 12, 1e-3)
    (t1, t2), (w1, w2), (d1, d2) = motion(t)
    a1, a2, a3, a4, a5 = ALPHA
    h, c = -0.5 * a2 * np.sin(t1 - t2), 0.5 * a2 * np.cos(t1 - t2)
    tau = np.stack([a1 * d1 + h * d2 + c * w2**2 + a4 * w1, h * d1 + a3 * d2 - c * w1**2 + a5 * w2], axis=1)
    log = RobotLog(t, np.stack([t1, t2], axis=1), tau + rng.normal(0, 0.01, tau.shape))

    t_module = np.arange(0.2504, 11.8, 1e-3)
    (t1, t2), (w1, w2), (d1, d2) = motion(t_module)
    ax = -L1 * (np.cos(t1) * w1**2 + np.sin(t1) * d1) + L2 * (np.cos(t2) * d2 - np.sin(t2) * w2**2)
    ay = L1 * (np.cos(t1) * d1 - np.sin(t1) * w1**2) + L2 * (np.sin(t2) * d2 + np.cos(t2) * w2**2)
    axes = np.stack([np.cos(t2) * ax + np.sin(t2) * ay, np.cos(t2) * ay - np.sin(t2) * ax], axis=1)
    codes = np.round((1.65 + (axes + rng.normal(0, 0.03, axes.shape)) / 9.80665 * 0.62) / 3.3 * 65536)
    counts = np.round(np.stack([t1, t2], axis=1) / (2 * np.pi / 400_000)).astype(np.int32)
    device = DeviceSamples(
        t_us=np.round((t_module + 3.0) * 1e6).astype(np.uint64),
        seq=np.arange(len(t_module), dtype=np.uint32),
        ax=codes[:, 0].astype(np.uint16),
        ay=codes[:, 1].astype(np.uint16),
        enc1=counts[:, 0],
        enc2=counts[:, 1],
        flags=np.zeros(len(t_module), dtype=np.uint8),
    )
    return Trial(name, "free", "free", log, device)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    setup = Setup(
        RobotSetup("planar-2r-absolute", (L1, L2)),
        EncoderSetup((400_000, 400_000), (0.0, 0.0), (1, 1)),
        AccelerometerSetup("ADXL203", 3.3, 65536, (1.65, 1.65), (0.62, 0.62), "link2", 0.0),
    )
    trials = (free_trial("free_01", 1), free_trial("free_02", 2))
    return write_study(Study("small", setup, trials), tmp_path_factory.mktemp("fit") / "small")


def test_fit_prints_writes_json_and_draws(folder: Path, tmp_path: Path) -> None:
    result = run("fit", folder, "--json", tmp_path / "fit.json", "--figures", tmp_path / "figures")
    assert result.exit_code == 0
    assert "alpha2" in result.output
    assert "accelerometer" in result.output
    document = json.loads((tmp_path / "fit.json").read_text())
    assert document["format"] == "impid-fit/1"
    for name, true in zip(document["robot"]["parameters"].values(), ALPHA, strict=True):
        assert name["value"] == pytest.approx(true, rel=0.02)
        assert name["ci95"][0] < name["value"] < name["ci95"][1]
    assert document["robot"]["vaf"]["tau1"] > 99
    assert document["trials"][0]["acceleration"] == "accelerometer"
    assert (tmp_path / "figures" / "robot.png").stat().st_size > 20_000


def test_json_on_standard_output_is_nothing_but_json(folder: Path) -> None:
    result = run("fit", folder, "--json", "-", "--acceleration", "angles")
    assert json.loads(result.stdout)["robot"]["acceleration"] == ["angles"]


def test_sync_gives_each_trial_its_offset(folder: Path) -> None:
    result = run("sync", folder, "--json", "-")
    trials = json.loads(result.stdout)["trials"]
    assert [trial["name"] for trial in trials] == ["free_01", "free_02"]
    for trial in trials:
        assert trial["offset_s"] == pytest.approx(3.0, abs=1e-6)
        assert trial["drift_ppm"] == pytest.approx(0.0, abs=0.1)
    assert "free_02" in run("sync", folder).output


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["fit", "nowhere"], "does not exist"),
        (["fit", "a.mcap"], "--setup"),
        (["sync", "a.mcap", "--setup", "s.toml"], "one --robot-log for each"),
    ],
)
def test_wrong_input_is_one_clear_error(arguments: list[str], words: str) -> None:
    with pytest.raises(ImpidError, match=words):
        run(*arguments)


def test_fixed_chain_refuses_another_cutoff(folder: Path) -> None:
    with pytest.raises(ImpidError, match="fixed cut-off"):
        run("fit", folder, "--chain", "published", "--cutoff", "6")


@pytest.mark.measured
def test_emps_reproduces_the_authors_parameters(measured_data: Path, tmp_path: Path) -> None:
    # Janot, Gautier, Brunot 2019: M 95.1089 kg, Fv 203.5034 N s/m, Fc 20.3935 N, offset -3.1648 N, 4.0834 %.
    study = tmp_path / "emps"
    mapping = CHECKOUT / "docs" / "mappings" / "emps.toml"
    run("import", measured_data / "emps" / "bangbang.parquet", "--mapping", mapping, "--out", study)
    terms = ["--with", "friction.coulomb", "--with", "actuator.offset"]
    result = run("fit", study, "--chain", "emps", *terms, "--validate", "0", "--json", "-")
    robot = json.loads(result.stdout)["robot"]
    value = {name: entry["value"] for name, entry in robot["parameters"].items()}
    assert value["M"] == pytest.approx(95.1089, rel=0.005)
    assert value["Fv"] == pytest.approx(203.5034, rel=0.005)
    assert value["Fc"] == pytest.approx(20.3935, rel=0.005)
    assert value["offset"] == pytest.approx(-3.1648, rel=0.02)
    assert robot["relative_error_percent"] == pytest.approx(4.0834, abs=0.1)
    assert robot["acceleration"] == ["angles"]
    assert robot["held_out"] is False


@pytest.mark.measured
def test_emps_by_instruments_of_the_simulated_model(measured_data: Path, tmp_path: Path) -> None:
    # Their reference is logged: the model is simulated under the controller that the record shows. Within two
    # of the authors' standard deviations of their numbers.
    study = tmp_path / "emps"
    mapping = CHECKOUT / "docs" / "mappings" / "emps.toml"
    run("import", measured_data / "emps" / "bangbang.parquet", "--mapping", mapping, "--out", study)
    terms = ["--with", "friction.coulomb", "--with", "actuator.offset", "--validate", "0"]
    result = run("fit", study, "--chain", "emps", *terms, "--estimator", "instruments", "--json", "-")
    robot = json.loads(result.stdout)["robot"]
    assert robot["estimator"]["by"] == "instruments"
    assert robot["estimator"]["instruments"] == "simulated model"
    value = {name: entry["value"] for name, entry in robot["parameters"].items()}
    assert value["M"] == pytest.approx(95.1089, abs=2 * 0.1085)
    assert value["Fv"] == pytest.approx(203.5034, abs=2 * 1.146)
    assert value["Fc"] == pytest.approx(20.3935, abs=2 * 0.1012)
    assert value["offset"] == pytest.approx(-3.1648, abs=2 * 0.0444)


def test_an_estimator_that_cannot_be_had_is_refused_in_words(tmp_path: Path) -> None:
    # The study has no module and no reference: nothing but the angles tells its motion.
    study = tmp_path / "study"
    trials = tuple(replace(free_trial(f"free_0{k}", k), device=None) for k in (1, 2))
    write_study(Study("angles", Setup(robot=RobotSetup("planar-2r-absolute", (L1, L2))), trials), study)
    refused = CliRunner().invoke(cli, ["fit", str(study), "--estimator", "instruments"])
    assert refused.exit_code != 0
    said = " ".join(str(refused.exception or refused.output).split())
    assert "there are no instruments" in said and "theta1_ref" in said
    shown = run("fit", study, "--estimator", "auto")
    assert "Estimated by least squares: it cannot be compared with anything" in " ".join(shown.output.split())


def test_links_that_move_as_one_show_combinations_alone(tmp_path: Path) -> None:
    # theta2 = theta1 - 90 deg: tau1 = (alpha1 - alpha2 / 2) theta'' + alpha4 omega and tau2 likewise, so that
    # alpha1 - alpha3 and alpha2 - 2 alpha3 are all that shows of three inertias.
    t = np.arange(0, 20, 1e-3)
    rng = np.random.default_rng(8)
    angular, phase = 2 * np.pi * rng.uniform(0.2, 2.0, (8, 1)), rng.uniform(0, 2 * np.pi, (8, 1))
    theta = 0.7 + 0.05 * np.sin(angular * t + phase).sum(axis=0)
    omega = 0.05 * (angular * np.cos(angular * t + phase)).sum(axis=0)
    theta_dd = -0.05 * (angular**2 * np.sin(angular * t + phase)).sum(axis=0)
    inertia = np.array([ALPHA[0] - 0.5 * ALPHA[1], ALPHA[2] - 0.5 * ALPHA[1]])
    tau = theta_dd[:, None] * inertia + omega[:, None] * ALPHA[3:] + rng.normal(0, 0.01, (len(t), 2))
    log = RobotLog(t=t, theta=np.stack([theta, theta - np.pi / 2], axis=1), tau=tau)
    setup = Setup(robot=RobotSetup("planar-2r-absolute", (L1, L2)))
    write_study(Study("rigid", setup, (Trial("free_01", "free", "free", log, None),)), tmp_path / "study")
    result = run("fit", tmp_path / "study", "--json", tmp_path / "fit.json")
    assert result.exit_code == 0, result.output
    shown = json.loads((tmp_path / "fit.json").read_text())["robot"]
    names = shown["parameters"]
    assert list(names) == ["alpha1 - alpha3", "alpha2 - 2*alpha3", "alpha4", "alpha5"]
    for name, truth in (
        ("alpha1 - alpha3", ALPHA[0] - ALPHA[2]),
        ("alpha2 - 2*alpha3", ALPHA[1] - 2 * ALPHA[2]),
    ):
        assert names[name]["value"] == pytest.approx(truth, rel=0.01)
        assert name in result.output
