"""`impid-host init`: what a dialogue and a URDF make of setup.toml."""

import datetime
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from impid_host.cli import cli
from impid_host.errors import InputError
from impid_host.study.model import Session
from impid_host.study.setup_file import read_setup

URDF = """<robot name="r"><link name="base"/><link name="a"/><link name="b"/><link name="hand"/>
<joint name="lift" type="prismatic"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
  <limit lower="0" upper="1" effort="1" velocity="1"/></joint>
<joint name="turn" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="tip" type="fixed"><parent link="b"/><child link="hand"/></joint></robot>"""


def answered(lines: list[str], *arguments: object) -> Result:
    return CliRunner().invoke(cli, ["init", *map(str, arguments)], input="\n".join(lines) + "\n")


def test_a_dialogue(tmp_path: Path) -> None:
    out = tmp_path / "setup.toml"
    lines = [
        "planar-2r-absolute",
        "0.254",
        "0.2667",
        "board",
        "",
        "0.1",
        "ADXL335",
        "400000",
        "8192",
        "0.135",
    ]
    done = answered([*lines, "P07", "left", "2026-11-30", "seated"], out)
    assert done.exit_code == 0, done.output
    setup = read_setup(out)
    assert setup.robot.link_lengths_m == (0.254, 0.2667)
    assert setup.encoder is not None
    assert setup.encoder.counts_per_rev == (400000, 8192)
    assert setup.accelerometer is not None
    # The ADXL335 gives 300 mV/g at 3 V and is ratiometric; its zero is half the supply.
    assert setup.accelerometer.sensitivity_V_per_g == pytest.approx((0.33, 0.33))
    assert setup.accelerometer.zero_g_V == (1.65, 1.65)
    assert setup.accelerometer.mount_angle_rad == 0.1
    assert setup.handle_mass_kg == 0.135
    assert setup.session == Session("P07", "left", datetime.date(2026, 11, 30), "seated")


def test_an_answer_that_does_not_fit_is_asked_again(tmp_path: Path) -> None:
    out = tmp_path / "setup.toml"
    done = answered(["joint-2d", "joint-1d", "none", "-1", "0", ""], out)
    assert done.exit_code == 0, done.output
    assert "'joint-2d' is not one of" in done.output
    assert "-1.0 is not in the range" in done.output
    setup = read_setup(out)
    assert (setup.robot.model, setup.encoder, setup.accelerometer) == ("joint-1d", None, None)


@pytest.mark.parametrize("by_option", [True, False])
def test_a_urdf_is_read_and_laid_beside(tmp_path: Path, by_option: bool) -> None:
    (tmp_path / "from").mkdir()
    urdf = tmp_path / "from" / "robot.urdf"
    urdf.write_text(URDF)
    out = tmp_path / "study" / "setup.toml"
    before = [] if by_option else ["urdf", str(urdf)]
    options = ["--urdf", urdf] if by_option else []
    done = answered([*before, "", "other", "fixed", "", "Xsens", "", ""], out, *options)
    assert done.exit_code == 0, done.output
    assert "2 joints: lift (slides), turn (turns); tip hand" in done.output
    setup = read_setup(out)
    assert setup.robot.urdf == tmp_path / "study" / "robot.urdf"
    assert setup.robot.urdf.read_text() == URDF
    assert setup.robot.joints == ()
    assert setup.accelerometer is not None
    assert (setup.accelerometer.part, setup.accelerometer.reads_codes) == ("Xsens", False)


def test_refusals(tmp_path: Path) -> None:
    out = tmp_path / "setup.toml"
    out.touch()
    done = answered([], out)
    assert isinstance(done.exception, InputError)
    assert "is there already" in str(done.exception)
    done = answered([], tmp_path / "other.toml", "--urdf", tmp_path / "none.urdf")
    assert isinstance(done.exception, InputError)
    assert "none.urdf: does not exist" in str(done.exception)
    (tmp_path / "r.urdf").write_text(URDF)
    done = answered(["turn lift"], tmp_path / "other.toml", "--urdf", tmp_path / "r.urdf")
    assert isinstance(done.exception, InputError)
    assert not (tmp_path / "other.toml").exists()
