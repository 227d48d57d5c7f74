"""`impid-host design` from the command line; the files are read back without the code that wrote them."""

import numpy as np
import pytest
import scipy.signal
from click.testing import CliRunner
from impid_host.cli import cli
from impid_host.errors import InputError

SETUP = """format = "impid-study/1"
[robot]
model = "planar-2r-absolute"
link_lengths_m = [0.254, 0.2667]
[prior]
alpha = [0.06929, 0.04217, 0.04416, 0.06510, 0.07389]
"""


@pytest.fixture
def setup(tmp_path):
    path = tmp_path / "setup.toml"
    path.write_text(SETUP)
    return path


def _run(*arguments):
    return CliRunner().invoke(cli, ["design", *map(str, arguments)], catch_exceptions=True)


def _read(path):
    table = np.genfromtxt(path, delimiter=",", names=True)
    return {name: table[name] for name in table.dtype.names}


def test_ten_sinusoids_have_ten_lines_below_two_hertz(setup, tmp_path):
    out = tmp_path / "sub" / "reference.csv"
    result = _run(
        "reference", "--setup", setup, "--out", out, "--period", 20, "--rate", 100,
        "--candidates", 3, "--centre", 45, "--centre", 60,
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    assert "condition of the robot's regressor" in result.output
    assert "alpha5" in result.output
    data = _read(out)
    steady = data["steady"] == 1
    assert steady.sum() == 2000
    for j, centre in ((1, 45.0), (2, 60.0)):
        theta = np.rad2deg(data[f"theta{j}"])
        assert np.all(np.abs(theta - centre) < 20.1)
        assert theta[0] == pytest.approx(centre)
        lines = np.abs(np.fft.rfft(theta[steady] - centre)) / 1000
        assert np.sum(lines > 1e-6) == 10
        assert np.all(lines[41:] < 1e-9)
        np.testing.assert_allclose(
            np.gradient(data[f"theta{j}"], data["t"])[2:-2], data[f"omega{j}"][2:-2], atol=0.02
        )


def test_perturbation_has_the_asked_rms_and_band(tmp_path):
    out = tmp_path / "perturbation.csv"
    result = _run("perturbation", "--out", out, "--rms", 4, "--candidates", 5)
    assert result.exit_code == 0, result.output
    data = _read(out)
    assert len(data["t"]) == 25000
    for name in ("fdx", "fdy"):
        assert data[name].std() == pytest.approx(4.0, rel=1e-6)
        f, power = scipy.signal.welch(data[name], fs=500.0, nperseg=4096)
        assert power[f > 25].sum() < 1e-4 * power.sum()


def test_modified_perturbation_needs_what_it_models(setup, tmp_path):
    out = tmp_path / "perturbation.csv"
    plain = _run("perturbation", "--out", out, "--rms", 4, "--candidates", 5)
    before = _read(out)["fdx"]
    result = _run("perturbation", "--out", out, "--rms", 4, "--candidates", 5, "--modify-for", setup)
    assert plain.exit_code == result.exit_code == 0, result.output
    assert "modified for the arm" in result.output
    # the robot's inertia and the hold take their part of the force: more must be commanded
    assert _read(out)["fdx"].std() > 1.2 * before.std()
    setup.write_text(SETUP.split("[prior]", maxsplit=1)[0])
    result = _run("perturbation", "--out", out, "--rms", 4, "--candidates", 5, "--modify-for", setup)
    assert isinstance(result.exception, InputError)
    assert "[prior] alpha" in str(result.exception)
    assert result.output == ""  # nothing is said to be written
    setup.write_text(SETUP.split("[prior]", maxsplit=1)[0] + "[prior]\nalpha = [0.07, 0.04]\n")
    result = _run("perturbation", "--out", out, "--rms", 4, "--candidates", 5, "--modify-for", setup)
    assert "alpha has 2 numbers" in str(result.exception)


def test_multisine_experiments_repeat_their_period_exactly(tmp_path):
    result = _run(
        "multisine", "--out", tmp_path, "--rms", 2, "--realisations", 2, "--periods", 2, "--period", 5
    )
    assert result.exit_code == 0, result.output
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == [f"force_r{r}_e{e}.csv" for r in (1, 2) for e in (1, 2)]
    data = _read(tmp_path / names[3])
    assert data["steady"].sum() == 5000
    assert data["fdy"].std() == pytest.approx(2.0)
    np.testing.assert_allclose(data["fdx"][:2500], data["fdx"][5000:], atol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--period", "2"], "ten sinusoids need"),
        (["--period", "20", "--speed-limit", "0.01", "--candidates", "2"], "speed limit"),
        (["--centre", "45"], "--centre was given 1 times"),
    ],
)
def test_impossible_wishes_end_in_one_line(setup, tmp_path, arguments, message):
    result = _run("reference", "--setup", setup, "--out", tmp_path / "r.csv", *arguments)
    assert result.exit_code != 0
    assert message in (result.output + str(result.exception)).replace("\n", " ")
    assert not (tmp_path / "r.csv").exists()


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    result = _run("perturbation", "--out", blocked / "x.csv", "--rms", 1, "--candidates", 2)
    assert isinstance(result.exception, InputError)
    assert "cannot be written" in str(result.exception)
