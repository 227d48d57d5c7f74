"""The live force against the offline one, and when it is there: recordings of the simulator in real time.

    python bench/live_force.py [--markdown FILE] [--keep FILE] [--realtime]

A model is fitted on a study of one seed; a trial of another seed is served by `impid-sim`, recorded with `record
--force`, and exported. The force that was shown is held against the virtual force of that trial (`fit`'s own), at the instants
that the observer itself names. When a row was shown is on the host's clock, which the recording matches with the
board's (exchanges), as the exported logs match the board's with the robot's: nothing of the observer's own clocks is
used. `--realtime` gives the recording's processes a real-time priority, for machines that are busy with other work.

A second table replays the same trials, without a clock on the wall, by angles alone and with the accelerometer, for
encoders of several resolutions.
"""

import argparse
import json
import os
import socket
import subprocess
import sys
import tempfile
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from impid_host.clock.device import fit_clock
from impid_host.impedance.campaign import default_chain
from impid_host.impedance.force import force_series
from impid_host.impedance.identify import RobotParameters
from impid_host.impedance.rows import finish
from impid_host.live import observer as live_observer
from impid_host.live.observer import LiveForce, Tuning
from impid_host.live.order import known_robot
from impid_host.live.torques import Rows
from impid_host.recording.reader import read_recording
from impid_host.robot.model import robot_model
from impid_host.samples import DeviceSamples
from impid_host.signals.align import AlignedTrial, align
from impid_host.signals.chain import Chain
from impid_host.study.folder import read_study
from impid_host.study.model import Study, Trial

from hil_sim.scenarios.load import SHIPPED

HOST = [sys.executable, "-c", "from impid_host.cli import main; main()"]
SIM = [sys.executable, "-c", "from hil_sim.cli import main; main()"]
LIVE = (("first-light", "spring_K1_M1_01"), ("dyck-2013-arm", "arm_01"), ("arm-stiffens", "arm"))
COUNTS = (400_000, 40_000, 8192)
WINDOW_S = 8.0
BATCH, LATE_S, BLOCK = 10, 0.003, 4  # of the board's samples; on its line; rows that come together


def run(*command: str | Path) -> str:
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(map(str, command[-8:]))}\n{done.stderr}")
    return done.stdout


def fitted(scenario: str, folder: Path) -> Path:
    """A model of the scenario's robot, from a study of another seed than the recordings'."""
    run(*SIM, "study", scenario, "--seed", "2", "--out", folder / "other")
    run(*HOST, "fit", folder / "other", "--save-model", folder / "model.json")
    return folder / "model.json"


def offline(
    study: Study, trial: Trial, robot: RobotParameters, chain: Chain
) -> tuple[AlignedTrial, np.ndarray, np.ndarray]:
    """The trial, its virtual force (N, d) and which rows count (N,)."""
    aligned = align(trial, study.setup, robot_model(study.setup.robot), chain)
    series = force_series(aligned, robot, chain)
    assert series.virtual is not None
    return aligned, series.virtual, series.valid


def relative(
    shown_t: np.ndarray,
    shown: np.ndarray,
    trial: AlignedTrial,
    force: np.ndarray,
    valid: np.ndarray,
    chain: Chain,
) -> dict[str, list[float]]:
    """rms of the difference, % of the offline force's rms about its mean, per axis: as shown, and in the offline band.

    Args:
        shown_t: on the module's clock.
    """
    inside = valid & (trial.t > shown_t[0] + chain.edge_s) & (trial.t < shown_t[-1] - chain.edge_s)
    own = np.stack([np.interp(trial.t, shown_t, axis) for axis in shown.T], axis=1)
    return {
        name: (
            100 * np.sqrt(np.mean((values - force)[inside] ** 2, axis=0)) / np.std(force[inside], axis=0)
        ).tolist()
        for name, values in (("shown", own), ("band", finish(chain, own, trial.rate_hz)))
    }


def live(scenario: str, name: str, folder: Path, *, realtime: bool) -> dict[str, Any]:
    """One recording in real time."""
    model = fitted(scenario, folder)
    out, log = folder / f"{name}.mcap", folder / "shown.jsonl"
    setup, load = out.with_suffix(".setup.toml"), os.getloadavg()[0]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        torques = "{}:{}".format(*free.getsockname())
    priority = ["chrt", "--rr", "1"] if realtime else []
    robot_log = out.with_suffix(".robot.csv")
    served = subprocess.Popen(
        [*priority, *SIM, "serve", scenario, "--trial", name, "--seed", "1", "--robot-log", robot_log, "--setup", setup, "--torques-to", torques],
        stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert served.stdout is not None
    ready = json.loads(served.stdout.readline())
    run(
        *priority, *HOST, "record", "--port", ready["port"], "--view", "--setup", setup, "--force", model, "--torques", torques,
        "--force-window", str(WINDOW_S), "--force-log", log, "--duration", str(ready["duration_s"] + 1), "--out", out,
    )  # fmt: skip
    closed = json.loads(served.communicate()[0].splitlines()[-1])
    run(*HOST, "export", out, "--out", folder / "study")
    study = read_study(folder / "study")
    (trial,) = study.trials
    robot, _ = known_robot(model, study.setup)
    chain = default_chain(read_study(folder / "other"))
    aligned, force, valid = offline(study, trial, robot, chain)
    messages = [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines()]
    shown = [m for m in messages if m["kind"] == "force"]
    recording = read_recording(out)
    (exchanges,) = recording.exchanges.values()
    clock = fit_clock(exchanges)
    first = next(k for k, m in enumerate(shown) if m["with_module"])
    known = shown[first:]
    result: dict[str, Any] = {"scenario": scenario, "trial": name, "load_average": load, "realtime": realtime}
    result["simulator_late_ms"] = 1e3 * closed["lag"]["worst_s"]
    result["with_module_percent"] = 100 * float(np.mean([m["with_module"] for m in known]))
    assert aligned.clock is not None
    for label, part in (("matched", known), ("all", shown)):
        t = aligned.clock.to_device(np.concatenate([m["t"] for m in part]))
        at = np.concatenate([[clock.board_us(m["host_ns"]) * 1e-6] * len(m["t"]) for m in part])
        late = 1e3 * (at - t)
        values = np.concatenate([m["force"] for m in part])
        result[label] = {
            "rows": len(t),
            "rms_percent": relative(t, values, aligned, force, valid, chain),
            "latency_ms": np.percentile(late, [50, 95, 99]).tolist(),
        }
    looks = [m for m in messages if m["kind"] == "stiffness" and "K" in m]
    begin = float(trial.robot.t[0])
    K = np.array([m["K"] for m in looks])
    ci = np.array([m["ci95"] for m in looks])
    true = truth(
        scenario,
        name,
        np.array([m["t"] for m in looks]) - begin - WINDOW_S / 2,
        float(trial.robot.t[-1]) - begin,
    )
    whole = np.array([m["t"] - begin >= WINDOW_S for m in looks])
    inside = (ci[..., 0] <= true) & (true <= ci[..., 1])
    result["stiffness"] = {
        "looks": int(whole.sum()),
        "first_s": min(m["t"] for m in looks) - begin,
        "half_width_percent": float(
            np.median(50 * (ci[whole, 0, 0, 1] - ci[whole, 0, 0, 0]) / K[whole, 0, 0])
        ),
        "holds_percent": 100 * float(inside[whole].mean()),
        "error_percent": float(100 * np.sqrt(np.mean((K[whole, 0, 0] / true[whole, 0, 0] - 1) ** 2))),
    }
    result["lost"] = sum(ledger.lost for ledger in recording.ledgers)
    result["balanced"] = all(ledger.balanced for ledger in recording.ledgers)
    return result


def truth(scenario: str, name: str, t: np.ndarray, duration: float) -> np.ndarray:
    """The scenario's K, (k, 2, 2), at s since the trial began."""
    content = tomllib.loads((SHIPPED / f"{scenario}.toml").read_text(encoding="utf-8"))
    load = next(trial["load"] for trial in content["trials"] if name.startswith(trial["name"]))
    K = np.tile(np.array(content["world"]["loads"][load]["K_N_per_m"]), (len(t), 1, 1))
    for effect in content.get("effects", []):
        assert effect["effect"] == "load.time_varying"
        assert effect["course"] == "ramp"
        K = K + np.multiply.outer(t / duration - 0.5, np.array(effect["K"]))
    return K


def replayed(counts: int, folder: Path) -> dict[str, Any]:
    """The first scenario's trial with other encoders, through the observer, with the module and without."""
    scenario, name = LIVE[0]
    text = (SHIPPED / f"{scenario}.toml").read_text(encoding="utf-8")
    own = folder / "encoders.toml"
    own.write_text(text.replace("[400000, 400000]", f"[{counts}, {counts}]"), encoding="utf-8")
    model = fitted(str(own), folder)
    run(*SIM, "study", own, "--seed", "1", "--out", folder / "study")
    study = read_study(folder / "study")
    trial = next(trial for trial in study.trials if trial.name == name)
    robot, _ = known_robot(model, study.setup)
    chain = default_chain(study)
    aligned, force, valid = offline(study, trial, robot, chain)
    assert aligned.force is not None
    sensor = aligned.force[valid]
    quick = np.std((aligned.force - finish(chain, aligned.force, aligned.rate_hz))[valid], axis=0) / np.std(
        sensor, axis=0
    )
    result: dict[str, Any] = {"counts_per_rev": counts, "above_band_percent": (100 * quick).tolist()}
    alone, own_tuning = replace(study.setup, accelerometer=None), live_observer.BY_ANGLES
    as_quick = Tuning(live_observer.WITH_MODULE.gain, own_tuning.memory_s)
    for label, setup, tuning in (
        ("module", study.setup, own_tuning),
        ("as_quick", alone, as_quick),
        ("angles", alone, own_tuning),
    ):
        live_observer.BY_ANGLES = tuning
        observer = LiveForce(setup, robot, WINDOW_S)
        clock, device, log = aligned.clock, trial.device, trial.robot
        assert clock is not None
        assert isinstance(device, DeviceSamples)
        observer.matched(clock, (1, 0))
        stamps, fed, shown = device.t_us * 1e-6, 0, []
        for k in range(0, len(log) - BLOCK, BLOCK):
            rows = Rows(log.t[k : k + BLOCK], log.theta[k : k + BLOCK], log.tau[k : k + BLOCK])
            now = float(clock.to_device(rows.t[-1:])[0])
            while fed + BATCH < len(stamps) and stamps[fed + BATCH - 1] + LATE_S <= now:
                part = slice(fed, fed + BATCH)
                names = ("t_us", "ax", "ay", "enc1", "enc2")
                piece = {"boot_id": 1, "run": 0, "flags": 0, "index": range(fed, fed + BATCH)}
                observer.module.take(piece | {each: getattr(device, each)[part] for each in names})
                fed += BATCH
            shown.append(observer.take(rows))
        t = clock.to_device(np.concatenate([part.t for part in shown]))
        result[label] = relative(
            t, np.concatenate([part.force for part in shown]), aligned, force, valid, chain
        )
    return result


def pair(values: list[float], digits: int = 1) -> str:
    return ", ".join(f"{value:.{digits}f}" for value in values)


def page(found: dict[str, Any]) -> str:
    lives, encoders = found["live"], found["encoders"]
    realtime = lives[0]["realtime"]
    loads = ", ".join(f"{one['load_average']:.0f}" for one in lives)
    lines = [
        "# The live force against the offline one",
        "",
        f"`python bench/live_force.py{' --realtime' if realtime else ''}`: trials of the simulator, recorded in real time with `record --force`, the robot's model from a study",
        "of another seed. Offline is the virtual force of the exported trial by the same model, as `fit` and `judge` work it out (zero phase, 4.5 Hz).",
        f"Two cores that had other work (load average {loads} when the recordings began){'; the recordings ran at real-time priority' if realtime else ''}.",
        "",
        "| trial | live less offline as shown, x and y, % | in the offline band, % | latency of a row: median, 95 %, 99 %, ms | the simulator itself late by at most, ms | samples lost by the recording |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for one in lives:
        part = one["matched"]
        books = "0, books balanced" if one["balanced"] and one["lost"] == 0 else f"{one['lost']}"
        lines.append(
            f"| {one['scenario']}:{one['trial']} | {pair(part['rms_percent']['shown'])} | {pair(part['rms_percent']['band'])} | {pair(part['latency_ms'])} | {one['simulator_late_ms']:.0f} | {books} |"
        )
    lines += [
        "",
        "rms of the difference, % of the offline force's rms about its mean, on rows from the first match of the clocks on. In the offline band: the shown force passed",
        "through the same 4.5 Hz. Latency is from the instant that a force belongs to until the observer hands it out: 5 ms of the observer's own, the simulator's blocks of",
        "4 ms, the line, the machine. The page adds up to 0.1 s, for it is pushed ten times a second. With the first seconds, in which the angles alone must do:",
        "",
        "| trial | as shown, x and y, % | latency: median, 95 %, 99 %, ms |",
        "| --- | --- | --- |",
    ]
    for one in lives:
        part = one["all"]
        lines.append(
            f"| {one['scenario']}:{one['trial']} | {pair(part['rms_percent']['shown'])} | {pair(part['latency_ms'])} |"
        )
    lines += [
        "",
        f"## Running stiffness, over {WINDOW_S:g} s",
        "",
        "| trial | first after, s | looks | 95 % half width of K_xx, median | rms error of K_xx | intervals of K that hold the truth |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for one in lives:
        s = one["stiffness"]
        lines.append(
            f"| {one['scenario']}:{one['trial']} | {s['first_s']:.1f} | {s['looks']} | {s['half_width_percent']:.1f} % | {s['error_percent']:.1f} % | {s['holds_percent']:.0f} % |"
        )
    lines += [
        "",
        "Truth is the scenario's K in the middle of the window. Looks a second apart share seven eighths of their data: some six windows of a trial are independent, so",
        "the last column says little about 95 %.",
        "",
        "## What the module brings",
        "",
        f"{LIVE[0][0]}:{LIVE[0][1]} replayed with other encoders, live less offline, x and y, %:",
        "",
        "| counts per turn | with the accelerometer, 5 ms of lag | by the angles alone, as quick | by the angles alone as it is used, 12.5 ms | the force sensor's own above 4.5 Hz |",
        "| --- | --- | --- | --- | --- |",
    ]
    for one in encoders:
        cells = [pair(one[label]["shown"]) for label in ("module", "as_quick", "angles")]
        lines.append(f"| {one['counts_per_rev']} | {' | '.join(cells)} | {pair(one['above_band_percent'])} |")
    lines += [
        "",
        "Percent of the offline force's rms, as shown. What the accelerometer saves is lag: as quick, the angles of coarse encoders are noisier, and where that does not matter they do as well alone.",
        "The last column is what the simulated force sensor has above 4.5 Hz: the robot's controller differentiates the same coarse counts and shakes the load. So much of the difference",
        "is no error of the live force, but force that the offline one leaves out.",
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--markdown", type=Path)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--realtime", action="store_true")
    asked = parser.parse_args()
    found: dict[str, Any] = {"live": [], "encoders": []}
    for scenario, name in LIVE:
        with tempfile.TemporaryDirectory() as folder:
            found["live"].append(live(scenario, name, Path(folder), realtime=asked.realtime))
        print(json.dumps(found["live"][-1]), flush=True)
    for counts in COUNTS:
        with tempfile.TemporaryDirectory() as folder:
            found["encoders"].append(replayed(counts, Path(folder)))
        print(json.dumps(found["encoders"][-1]), flush=True)
    if asked.keep:
        asked.keep.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    if asked.markdown:
        asked.markdown.write_text(page(found), encoding="utf-8")


if __name__ == "__main__":
    main()
