"""A small study written by hand, line by line, for the tests of this folder to read and to break."""

from pathlib import Path

import pytest

SETUP = """\
format = "impid-study/1"
[robot]
model = "planar-2r-absolute"
link_lengths_m = [0.254, 0.2667]
[encoder]
counts_per_rev = [400000, 400000]
zero_rad = [0.0, 0.0]
direction = [1, -1]
[accelerometer]
part = "ADXL203"
vref_V = 3.3
full_scale_code = 65536
zero_g_V = [1.65, 1.65]
sensitivity_V_per_g = [0.62, 0.62]
mount = "link2"
mount_angle_rad = 0.0
[handle]
mass_kg = 0.135
[prior]
alpha = [0.06929, 0.04217, 0.04416, 0.06510, 0.07389]
"""

ROBOT = """\
t,theta1,theta2,tau1,tau2
0.0,0.1,-0.2,1.5,-2.5
0.001,0.11,-0.21,1.6,-2.6
0.002,0.12,-0.22,1.7,-2.7
"""

DEVICE = """\
t_us,seq,ax,ay,enc1,enc2,flags
18446744073709549000,4294967294,0,65535,-2147483648,2147483647,0
18446744073709550000,4294967295,32768,32767,2147483647,-2147483648,1
18446744073709551000,0,1,2,3,-4,16
"""


@pytest.fixture
def study_folder(tmp_path: Path) -> Path:
    """`s/` with one free trial `free_01` (three rows, module and robot)."""
    trial = tmp_path / "s" / "free_01"
    trial.mkdir(parents=True)
    (tmp_path / "s" / "setup.toml").write_text(SETUP)
    (trial / "trial.toml").write_text('kind = "free"\n')
    (trial / "robot.csv").write_text(ROBOT)
    (trial / "device.csv").write_text(DEVICE)
    return tmp_path / "s"
