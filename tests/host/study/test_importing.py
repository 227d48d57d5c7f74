"""Importing logs that independent writers made (csv, scipy, h5py, pyarrow); wrong mappings."""

import csv
import json
import math
import struct
import zlib
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from impid_host.errors import InputError
from impid_host.study.importing import import_logs
from impid_host.study.model import RobotLog
from impid_host.study.notices import StudyWarning

T = np.arange(40) * 0.01
ANGLE_DEG = 30 * np.sin(T)
DRIVE_V = np.cos(3 * T)

MAPPING = """\
[setup.robot]
model = "joint-1d"
[columns]
t = { column = "time", unit = "ms" }
theta1 = { column = "angle", unit = "deg" }
tau1 = { expression = "2.5 * drive - 0.5", unit = "mN*m" }
[[trial]]
name = "free_01"
kind = "free"
"""


def write_csv(path: Path) -> None:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time", "angle", "drive"])
        writer.writerows(zip((1e3 * T).tolist(), ANGLE_DEG.tolist(), DRIVE_V.tolist(), strict=True))


def write_parquet(path: Path) -> None:
    pq.write_table(
        pa.table({"time": 1e3 * T, "angle": ANGLE_DEG, "drive": DRIVE_V, "name": ["x"] * 40}), path
    )


def write_mat5(path: Path) -> None:
    cell = np.array([1, "a"], dtype=object)
    scipy.io.savemat(path, {"time": 1e3 * T, "angle": ANGLE_DEG, "drive": DRIVE_V, "cell": cell, "z": 1j})


def write_mat73(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in (("time", 1e3 * T), ("angle", ANGLE_DEG), ("drive", DRIVE_V)):
            file.create_dataset(name, data=values[np.newaxis])  # MATLAB stores a column as one row
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116))


def check(log: RobotLog) -> None:
    """The three columns by their definition, not by the importer's arithmetic."""
    np.testing.assert_allclose(log.t, [i / 100 for i in range(40)], rtol=0, atol=1e-15)
    expected = [math.radians(30 * math.sin(i / 100)) for i in range(40)]
    np.testing.assert_allclose(log.theta[:, 0], expected, rtol=1e-14, atol=1e-16)
    torque = [(2.5 * math.cos(3 * i / 100) - 0.5) / 1000 for i in range(40)]
    np.testing.assert_allclose(log.tau[:, 0], torque, rtol=1e-13, atol=1e-17)


def run(tmp_path: Path, mapping: str, *logs: Path) -> RobotLog:
    path = tmp_path / "map.toml"
    path.write_text(mapping)
    return import_logs(logs, path, "s").trials[0].robot


@pytest.mark.parametrize(
    ("name", "write"),
    [("a.csv", write_csv), ("a.parquet", write_parquet), ("a.mat", write_mat5), ("b.mat", write_mat73)],
)
def test_the_same_log_in_every_format(tmp_path: Path, name: str, write) -> None:
    write(tmp_path / name)
    check(run(tmp_path, MAPPING, tmp_path / name))


@pytest.mark.parametrize(
    ("options", "text", "columns"),
    [
        ('delimiter = ";"\ndecimal = ","', "t;q;u\n0,5;1,25;-2e0\n", ("t", "q", "u")),
        ('delimiter = "\\t"', "t\tq\tu\n0.5\t1.25\t-2\n", ("t", "q", "u")),
        (
            'delimiter = "whitespace"\nheader = false\ncomment = "%"',
            "% made by x\n 0.5  1.25\t-2 \n%\n",
            (1, 2, 3),
        ),
        ("header = false", "0.5,1.25,-2\n", (1, "2", 3)),
        ("skip_rows = 2", "version 3\nsite,x\nt,q,u\n0.5,1.25,-2\n", ("t", "q", "u")),
        ("", '"t [s]","q, joint","u"\r\n0.5,1.25,-2\r\n', ("t [s]", "q, joint", "u")),
    ],
)
def test_csv_dialects(tmp_path: Path, options: str, text: str, columns: tuple[str | int, ...]) -> None:
    log = tmp_path / "log.txt"
    log.write_bytes(text.encode())
    t, q, u = (json.dumps(name) for name in columns)
    mapping = (
        f'[setup.robot]\nmodel = "slide-1d"\n[log]\n{options}\n[columns]\nt = {t}\ntheta1 = {q}\ntau1 = {u}\n'
        '[[trial]]\nkind = "free"\n'
    )
    robot = run(tmp_path, mapping, log)
    assert (robot.t.tolist(), robot.theta.tolist(), robot.tau.tolist()) == ([0.5], [[1.25]], [[-2.0]])


@pytest.mark.parametrize("version", ["5", "7.3"])
def test_matrices_and_structures(tmp_path: Path, version: str) -> None:
    q = np.column_stack([T, 2 * T])
    if version == "5":
        scipy.io.savemat(tmp_path / "m.mat", {"log": {"q": q, "tau": q.T}})
    else:
        with h5py.File(tmp_path / "m.mat", "w") as file:
            file["log/q"], file["log/tau"] = q.T, q
            file["log/loop"] = file["log"]  # a group linked into itself must not be walked for ever
    mapping = """
        [setup.robot]
        model = "planar-2r-relative"
        link_lengths_m = [0.3, 0.2]
        [log]
        rate_hz = 100
        [columns]
        theta1 = "log.q[1]"
        theta2 = "log.q[2]"
        tau1 = "log.tau[1]"
        tau2 = { expression = 'col("log.tau[2]")' }
        [[trial]]
        kind = "free"
    """
    robot = run(tmp_path, mapping, tmp_path / "m.mat")
    np.testing.assert_array_equal(robot.theta, q)
    np.testing.assert_array_equal(robot.tau, q)
    np.testing.assert_allclose(robot.t, T, atol=1e-15)


def test_row_range_patterns_and_own_columns(tmp_path: Path) -> None:
    for name in ("a b.csv", "c.csv"):
        write_csv(tmp_path / name)
    (tmp_path / "other.csv").write_text("x\n1\n")
    mapping = MAPPING.replace(
        'name = "free_01"', 'name = "{stem}_01"\nfile = "?*.csv"\nstart_s = 0.1\nstop_s = 0.2'
    )
    path = tmp_path / "map.toml"
    path.write_text(mapping.replace("?*", "[ac]*") + '[trial.columns]\ntau1 = "drive"\n')
    with pytest.warns(StudyWarning, match=r"other.csv: no \[\[trial\]\]"):
        study = import_logs([tmp_path / name for name in ("c.csv", "a b.csv", "other.csv")], path, "s")
    assert [trial.name for trial in study.trials] == ["a_b_01", "c_01"]
    assert study.trials[0].robot.t.tolist() == pytest.approx(T[10:20].tolist())
    np.testing.assert_array_equal(study.trials[1].robot.tau[:, 0], DRIVE_V[10:20])


def test_incomplete_rows_are_named_or_left_out(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("time,angle,drive\n0,1,2\n10,,2\n20,1,2\n")
    with pytest.raises(
        InputError, match=r"log.csv, row 3: theta1 is empty or NaN in 1 rows.*drop_incomplete_rows"
    ):
        run(tmp_path, MAPPING, log)
    with pytest.warns(StudyWarning, match="1 incomplete rows left out"):
        robot = run(tmp_path, "log.drop_incomplete_rows = true\n" + MAPPING, log)
    assert robot.t.tolist() == [0.0, 0.02]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('column = "angle"', 'column = "winkel"', "has no column winkel, which"),
        ('column = "angle"', 'column = "winkel"', "(it has: time, angle, drive)"),
        ('unit = "deg"', 'unit = "mm"', 'unit "mm" has another dimension; an angle such as rad was expected'),
        ('unit = "deg"', 'unit = "count"', 'unit "count" is no angle'),
        ('unit = "deg"', 'unit = "grad eaux"', "is not known; an angle such as rad was expected"),
        ('unit = "ms"', 'unit = "N"', "a time such as s was expected"),
        ('unit = "mN*m"', 'unit = "N"', "a torque such as N*m was expected"),
        ("2.5 * drive", "2.5 * dirve", "has no column dirve"),
        ("2.5 * drive", "2.5 * * drive", "columns.tau1.expression"),
        ("2.5 * drive", "drive.tofile(pi)", "columns.tau1.expression"),
        ("2.5 * drive", "__import__('os')", "columns.tau1.expression"),
        ("2.5 * drive", "'a' * 10**9", "columns.tau1.expression"),
        ("2.5 * drive", "9**9**9**9 * drive", "magnitude above"),
        ("2.5 * drive", "(" * 300 + "drive" + ")" * 300, "columns.tau1.expression"),
        ("theta1 =", "theta2 =", "key `columns.theta1` is missing"),
        ("theta1 =", "thetaa = 1\ntheta1 =", "key `columns.thetaa` is no column of this study"),
        ("theta1 =", 'fx = "drive"\ntheta1 =', "key `columns.fx` stands alone"),
        ('t = { column = "time", unit = "ms" }', "", "give [log] rate_hz"),
        ('model = "joint-1d"', 'model = "joint"', "key `setup.robot.model` = 'joint'"),
        ('kind = "free"', "", "key `trial[0].kind` is missing"),
        ('kind = "free"', 'kind = "free"\nstart_s = 7.0', "it covers 0 s to 0.39 s"),
        ('kind = "free"', 'kind = "free"\nfile = "*.mat"', "the logs given are log.csv"),
        ('name = "free_01"', 'name = "../free"', "cannot name a folder"),
        ('[[trial]]\nname = "free_01"\nkind = "free"', "", "key `trial` is missing"),
        ("[columns]", '[log]\ndelimiter = "ab"\n[columns]', "delimiter must be one character"),
        ("[columns]", "[log]\nrate_hz = 0\n[columns]", "key `log.rate_hz`"),
    ],
)
def test_a_wrong_mapping_is_one_clear_line(tmp_path: Path, old: str, new: str, says: str) -> None:
    write_csv(tmp_path / "log.csv")
    assert old in MAPPING
    with pytest.raises(InputError) as caught:
        run(tmp_path, MAPPING.replace(old, new), tmp_path / "log.csv")
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["log.csv", "log.parquet", "log.mat"])
@pytest.mark.parametrize(
    "content", [b"", b"\x00\xff" * 400, b"PAR1 and nothing else", b"MATLAB 5.0 MAT-file" + b" " * 105]
)
def test_no_log_at_all(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError) as caught:
        run(tmp_path, MAPPING, tmp_path / name)
    assert name in str(caught.value)


def test_truncated_binary_logs(tmp_path: Path) -> None:
    for name, write in (("a.parquet", write_parquet), ("a.mat", write_mat5), ("b.mat", write_mat73)):
        write(tmp_path / name)
        whole = (tmp_path / name).read_bytes()
        (tmp_path / name).write_bytes(whole[: len(whole) * 2 // 3])
        with pytest.raises(InputError):
            run(tmp_path, MAPPING, tmp_path / name)


def test_columns_of_different_length(tmp_path: Path) -> None:
    scipy.io.savemat(tmp_path / "m.mat", {"time": T, "angle": T[:-3], "drive": T})
    with pytest.raises(InputError, match=r"different length: t \(time\) 40, theta1 \(angle\) 37"):
        run(tmp_path, MAPPING, tmp_path / "m.mat")


def test_an_hdf5_file_cannot_claim_the_memory_or_reach_out(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "huge.mat", "w") as file:
        file.create_dataset("time", shape=(2**40,), chunks=(1024,), dtype="f8")
    with pytest.raises(InputError, match="claims more than one trial can hold"):
        run(tmp_path, MAPPING, tmp_path / "huge.mat")
    (tmp_path / "secret.bin").write_bytes(T.tobytes())
    with h5py.File(tmp_path / "out.mat", "w") as file:
        file.create_dataset("time", (40,), "f8", external=[(str(tmp_path / "secret.bin"), 0, 320)])
        file["angle"] = h5py.ExternalLink(str(tmp_path / "huge.mat"), "time")
        file["drive"] = T
    with pytest.raises(InputError, match=r"\(it has: drive\)"):
        run(tmp_path, MAPPING, tmp_path / "out.mat")


def test_a_small_mat_file_that_unpacks_to_gigabytes_is_refused(tmp_path: Path) -> None:
    packer = zlib.compressobj(9)
    packed = b"".join(packer.compress(bytes(1 << 20)) for _ in range(600)) + packer.flush()
    header = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H2s", 0x0100, b"IM")
    (tmp_path / "bomb.mat").write_bytes(header + struct.pack("<II", 15, len(packed)) + packed)
    assert len(packed) < 1 << 20
    with pytest.raises(InputError, match="unpacks to more than one trial can hold"):
        run(tmp_path, MAPPING, tmp_path / "bomb.mat")


def test_compressed_mat_files_are_read(tmp_path: Path) -> None:
    columns = {"time": 1e3 * T, "angle": ANGLE_DEG, "drive": DRIVE_V}
    scipy.io.savemat(tmp_path / "c.mat", columns, do_compression=True)
    check(run(tmp_path, MAPPING, tmp_path / "c.mat"))


def test_a_crash_of_the_mat_reader_is_an_error_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_mat5(tmp_path / "m.mat")
    crashing = tmp_path / "python"
    crashing.write_text("#!/bin/sh\nkill -SEGV $$\n")
    crashing.chmod(0o755)
    monkeypatch.setattr("impid_host.study.mat_log.sys.executable", str(crashing))
    with pytest.raises(InputError, match=r"m.mat: is no readable MATLAB file .*the reader crashed"):
        run(tmp_path, MAPPING, tmp_path / "m.mat")


def test_mat_objects_run_nothing(tmp_path: Path) -> None:
    scipy.io.savemat(tmp_path / "m.mat", {"time": np.array([[1, "x"]], dtype=object), "angle": T, "drive": T})
    with pytest.raises(InputError, match="has no column time"):
        run(tmp_path, MAPPING, tmp_path / "m.mat")
