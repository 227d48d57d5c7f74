"""Logs as laboratories have them: Simulink structures, decimal commas, broken first rows, clocks in words."""

import warnings
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
from impid_host.errors import InputError
from impid_host.samples import ForeignSamples
from impid_host.study.folder import read_study, write_study
from impid_host.study.importing import import_logs
from impid_host.study.model import Study

T = np.arange(200) * 0.01
Q = np.stack([np.sin(T), np.cos(T)], axis=1)
TAU = np.stack([0.5 * T, -0.25 * T], axis=1)

SLIDE = """
[setup.robot]
model = "slide-1d"
{log}
[columns]
t = {t}
theta1 = {x}
tau1 = {u}
[[trial]]
kind = "free"
name = "free_01"
{trial}
"""


def imported(tmp_path: Path, mapping: str, log: Path) -> Study:
    (tmp_path / "map.toml").write_text(mapping)
    return import_logs([log], tmp_path / "map.toml", "s")


def slide(*, t: str = '"t"', x: str = '"x"', u: str = '"u"', log: str = "", trial: str = "") -> str:
    return SLIDE.format(t=t, x=x, u=u, log=log, trial=trial)


PLANAR = """
[setup.robot]
model = "planar-2r-relative"
link_lengths_m = [0.3, 0.2]
[columns]
t = "out.time"
theta1 = "out.signals[1].values[1]"
theta2 = "out.signals[1].values[2]"
tau1 = "out.signals[2].values[1]"
tau2 = "out.signals[2].values[2]"
[[trial]]
kind = "free"
name = "free_01"
"""


def structure_with_time_v7(path: Path) -> None:
    """As Simulink's To Workspace block writes it: `signals` is a 1x2 array of structures."""
    signals = np.zeros((1, 2), dtype=[("values", "O"), ("dimensions", "O"), ("label", "O")])
    signals[0, 0] = (Q, 2.0, "angle")
    signals[0, 1] = (TAU, 2.0, "torque")
    out = {"time": T[:, None], "signals": signals, "blockName": "rig/To Workspace"}
    scipy.io.savemat(path, {"out": out}, do_compression=True)


def structure_with_time_v73(path: Path) -> None:
    """The same as MATLAB lays it out in HDF5: each field of the array holds references to its values."""
    with h5py.File(path, "w", userblock_size=512) as file:
        out = file.create_group("out")
        out.create_dataset("time", data=T[None])
        signals = out.create_group("signals")
        refs = file.create_group("#refs#")
        kept = [refs.create_dataset(name, data=values.T) for name, values in (("a", Q), ("b", TAU))]
        signals.create_dataset("values", data=np.array([[k.ref] for k in kept], dtype=h5py.ref_dtype))
        label = refs.create_dataset("c", data=np.array([[97], [98]], dtype=np.uint16))
        label.attrs["MATLAB_class"] = np.bytes_("char")
        signals.create_dataset("label", data=np.array([[label.ref]] * 2, dtype=h5py.ref_dtype))
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116))


@pytest.mark.parametrize("write", [structure_with_time_v7, structure_with_time_v73])
def test_simulinks_structure_with_time(tmp_path: Path, write) -> None:
    write(tmp_path / "log.mat")
    robot = imported(tmp_path, PLANAR, tmp_path / "log.mat").trials[0].robot
    np.testing.assert_array_equal(robot.t, T)
    np.testing.assert_array_equal(robot.theta, Q)
    np.testing.assert_array_equal(robot.tau, TAU)


def test_a_single_signal_and_deep_nesting(tmp_path: Path) -> None:
    one = {"time": T[:, None], "signals": {"values": Q[:, :1], "label": "x"}}
    deep = {"a": {"b": {"c": {"d": {"tau": TAU[:, 0]}}}}}
    scipy.io.savemat(tmp_path / "log.mat", {"out": one, "deep": deep})
    mapping = slide(t='"out.time"', x='"out.signals.values"', u='"deep.a.b.c.d.tau"')
    robot = imported(tmp_path, mapping, tmp_path / "log.mat").trials[0].robot
    np.testing.assert_array_equal(robot.theta[:, 0], Q[:, 0])
    np.testing.assert_array_equal(robot.tau[:, 0], TAU[:, 0])


def test_an_object_in_hdf5_is_named_with_what_to_do(tmp_path: Path) -> None:
    """A timeseries is an object: six integers that point into the file's own store."""
    with h5py.File(tmp_path / "log.mat", "w") as file:
        dataset = file.create_dataset("ts", data=np.array([[0xDD000000, 2, 1, 1, 1, 1]], dtype=np.uint32))
        dataset.attrs["MATLAB_class"] = np.bytes_("timeseries")
        dataset.attrs["MATLAB_object_decode"] = np.int32(3)
        file["t"] = T
    with pytest.raises(InputError, match=r"ts is an object.*struct\('time', ts\.Time, 'data', ts\.Data\)"):
        imported(tmp_path, slide(x='"ts"', u='"t"'), tmp_path / "log.mat")


@pytest.mark.parametrize(
    ("u", "says"),
    [
        ('{ expression = "atan2(u, v, x)" }', "atan2 3 values; it takes 2"),
        ('{ expression = "abs(u, v)" }', "abs 2 values; it takes 1"),
        ('{ expression = "unwrap(u, 3)" }', "unwrap 2 values; it takes 1"),
        ('{ column = "u", scale = 0 }', "scale must not be zero"),
        ('{ column = "u", unit = "g" }', "another dimension"),
    ],
)
def test_no_argument_is_swallowed(tmp_path: Path, u: str, says: str) -> None:
    (tmp_path / "log.csv").write_text("t,x,u,v\n0,1,2,3\n0.1,1,2,3\n")
    with pytest.raises(InputError) as caught:
        imported(tmp_path, slide(u=u), tmp_path / "log.csv")
    assert says in str(caught.value)


def test_the_smallest_and_largest_of_three(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t,x,u,v\n0,1,2,3\n0.1,9,5,7\n")
    mapping = slide(x='{ expression = "minimum(u, v, x)" }', u='{ expression = "maximum(u, v, x)" }')
    robot = imported(tmp_path, mapping, tmp_path / "log.csv").trials[0].robot
    assert (robot.theta[:, 0].tolist(), robot.tau[:, 0].tolist()) == ([1.0, 5.0], [3.0, 9.0])


BROKEN_START = "t,x,u\n1e30,1,2\n0.0,garbage,2\n0.1,3\n0.2,1e9,4\n0.3,5,1e9\n0.4,6,7\n0.5,8,9\n"


def test_broken_first_rows_can_be_cut_away(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text(BROKEN_START)
    robot = imported(tmp_path, slide(trial="start_s = 0.35"), log).trials[0].robot
    assert robot.tau[:, 0].tolist() == [7.0, 9.0]
    with pytest.raises(InputError, match=r"row 6: column tau1 holds a magnitude"):
        imported(tmp_path, slide(trial="start_s = 0.25"), log)
    with pytest.raises(InputError, match=r"row 4: has 2 cells where there are 3 columns"):
        imported(tmp_path, slide(trial="start_s = 0.05"), log)
    with pytest.raises(InputError, match=r"row 3: column x holds 'garbage'"):
        imported(tmp_path, slide(trial="start_s = -1"), log)


def test_a_row_without_time_inside_the_range_is_not_passed_over(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("t,x,u\n0,1,2\n1,1,2\noops,1,2\n3,1,2\n4,1,2\n")
    with pytest.raises(InputError, match=r"row 4: column t holds 'oops'"):
        imported(tmp_path, slide(trial="start_s = 0.5"), log)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("t;x;u\n0,0;1,5;2\n", 'delimiter = ";"'),
        ("t\tx\tu\n0\t1\t2\n", 'delimiter = "\\t"'),
        ("t,x,u\n0.0,1.5;7,2\n", 'delimiter = ";"'),
        ('t,x,u\n0.0,"1,5",2\n', 'decimal = ","'),
        ("t,x,u\n0,0,1,5,2,0\n", 'decimal = ","'),
    ],
)
def test_another_dialect_is_hinted_at(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "log.csv").write_text(text)
    with pytest.raises(InputError) as caught:
        imported(tmp_path, slide(), tmp_path / "log.csv")
    assert says in str(caught.value)


def test_an_encoding_is_warned_of_once(tmp_path: Path) -> None:
    rows = "".join(f"{k};1,5;2\n" for k in range(5))
    (tmp_path / "log.csv").write_bytes(f"t;x;u;µ\n{rows}".replace(";2\n", ";2;0\n").encode("latin-1"))
    mapping = (
        slide(log='[log]\ndelimiter = ";"\ndecimal = ","') + '[[trial]]\nkind = "free"\nname = "free_02"\n'
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        imported(tmp_path, mapping, tmp_path / "log.csv")
    assert [str(w.message) for w in caught if "Latin-1" in str(w.message)] == [
        f"{tmp_path / 'log.csv'}: is not UTF-8; read as Latin-1"
    ]


def test_a_clock_in_words(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("when,x,u\n23:59:59.900,1,2\n00:00:00.150,1,2\n00:00:00.400,1,2\n")
    robot = imported(tmp_path, slide(t='"when"'), tmp_path / "log.csv").trials[0].robot
    assert robot.t == pytest.approx([86399.9, 86400.15, 86400.4])


ACCELERATIONS = """
[setup.robot]
model = "planar-2r-absolute"
link_lengths_m = [0.25, 0.27]
[setup.accelerometer]
mount = "link2"
mount_angle_rad = 0.5
[columns]
t = "t"
theta1 = "q1"
theta2 = "q2"
tau1 = "u1"
tau2 = "u2"
acc_x = { column = "ax", unit = "standard_gravity" }
acc_y = { column = "ay", scale = -1 }
[[trial]]
kind = "free"
name = "free_01"
"""


def test_accelerations_beside_the_robots_columns_make_a_module(tmp_path: Path) -> None:
    rows = "".join(f"{-0.5 + 0.01 * k:.2f},0.1,0.2,1,2,{0.001 * k:.3f},{k}\n" for k in range(120))
    (tmp_path / "log.csv").write_text("t,q1,q2,u1,u2,ax,ay\n" + rows)
    write_study(imported(tmp_path, ACCELERATIONS, tmp_path / "log.csv"), tmp_path / "s")
    trial = read_study(tmp_path / "s").trials[0]
    device = trial.device
    assert isinstance(device, ForeignSamples)
    assert device.acceleration is not None
    assert device.acceleration[:3].tolist() == [
        [0, 0],
        [pytest.approx(9.80665e-3), -1],
        [pytest.approx(19.6133e-3), -2],
    ]
    # A module's stamps begin at zero: both are shifted alike.
    assert trial.robot.t == pytest.approx(0.5 + 0.01 * np.arange(120))
    assert device.t_us * 1e-6 == pytest.approx(trial.robot.t)
    assert "vref_V" not in (tmp_path / "s" / "setup.toml").read_text()


def test_accelerations_need_to_be_placed_and_in_pairs(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t,q1,q2,u1,u2,ax,ay\n0,0,0,0,0,0,0\n")
    unplaced = ACCELERATIONS.replace('[setup.accelerometer]\nmount = "link2"\nmount_angle_rad = 0.5\n', "")
    with pytest.raises(InputError, match=r"key `setup\.accelerometer` is missing"):
        imported(tmp_path, unplaced, tmp_path / "log.csv")
    alone = ACCELERATIONS.replace('acc_y = { column = "ay", scale = -1 }\n', "")
    with pytest.raises(InputError, match=r"`columns\.acc_x` stands alone"):
        imported(tmp_path, alone, tmp_path / "log.csv")
    gram = ACCELERATIONS.replace("standard_gravity", "g")
    with pytest.raises(InputError, match="the gram"):
        imported(tmp_path, gram, tmp_path / "log.csv")
