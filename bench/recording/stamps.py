"""Whose time stamps are how wrong: impid-host, Klipper's filter, Lab Streaming Layer and python-can's logger.

`stamps.py [SECONDS]`. A board whose clock is the PC's own, so that the true instant of every sample is known;
each recorder gets it over the same kind of link. LSL and python-can stamp what arrives, which is later than
what was sampled by the filter's 2 ms, the batch and the operating system. LSL has no recorder on PyPI: its
inlet writes lines, as its example does.
"""

import importlib.util
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import can
import numpy as np
from common import RECORD, CanBoard, PtyBoard, board_us, bus_at, exchanges, free_multicast, save
from impid_host.clock.device import OnlineClock, fit_clock
from impid_host.recording.reader import read_recording
from impid_host.wire.messages import ENCODER
from klipper_filter import klipper

SETTLED_S = 5.0

GATEWAY = """
import sys
import numpy as np, pylsl
from impid_host.link.client import BoardClient
from impid_host.link.port import SerialLink
outlet = pylsl.StreamOutlet(pylsl.StreamInfo("impid-bench", "Motion", 4, 1000, "int32", sys.argv[2]))
class Push:
    def received(self, chunk, decoded):
        for segment in decoded.segments:
            s = segment.samples
            rows = np.column_stack([s.enc1, s.enc2, s.ax, s.ay]).astype(np.int32)
            outlet.push_chunk(rows.tolist(), chunk.monotonic_ns * 1e-9)
    def sent(self, chunk): pass
    def exchanged(self, exchange, boot_id): pass
while not outlet.wait_for_consumers(1.0):
    pass
client = BoardClient(SerialLink.open(sys.argv[1]), Push())
client.start()
while True:
    client.pump(0.05)
"""

INLET = """
import csv, sys
import pylsl
found = pylsl.resolve_byprop("source_id", sys.argv[1], timeout=30)
flags = pylsl.proc_clocksync | (pylsl.proc_dejitter if sys.argv[3] == "dejitter" else 0)
inlet = pylsl.StreamInlet(found[0], processing_flags=flags)
with open(sys.argv[2], "w", newline="") as file:
    out = csv.writer(file)
    while True:
        rows, stamps = inlet.pull_chunk(timeout=0.02)
        out.writerows([repr(stamp), row[0]] for row, stamp in zip(rows, stamps))
"""


def summary(errors_us: np.ndarray) -> dict[str, float]:
    """Mean, spread and worst of time stamp errors, us."""
    return {
        "mean_us": float(errors_us.mean()),
        "rms_about_mean_us": float(errors_us.std()),
        "worst_us": float(np.abs(errors_us).max()),
    }


def ours(seconds: float, folder: Path) -> dict[str, dict[str, float]]:
    """impid-host record, its clock offline and online, and Klipper's filter on the same raw exchanges."""
    board, out = PtyBoard(), folder / "stamps.mcap"
    subprocess.run(
        [*RECORD, "--port", board.port, "--duration", str(seconds), "--out", str(out)],
        check=True,
        capture_output=True,
    )
    board.close()
    zero_us = board.clock_zero_s * 1e6
    recording = read_recording(out)
    exchanges = recording.exchanges[recording.segments[0].boot_id]
    fit = fit_clock(exchanges)
    instants_us = np.array([each.t4_ns * 1e-3 for each in exchanges])
    settled = instants_us > instants_us[0] + SETTLED_S * 1e6
    offline = np.array([fit.board_us(t * 1e3) for t in instants_us]) - (instants_us - zero_us)
    clock, online = OnlineClock(), []
    for each in exchanges:
        clock.add(each)
        now = clock.estimate()
        online.append(np.nan if now is None else now.board_us(each.t4_ns) - (each.t4_ns * 1e-3 - zero_us))
    slow = exchanges[::10]
    return {
        "impid-host, offline": summary(offline) | {"hard_bound_us": fit.hard_bound_us},
        "impid-host, online": summary(np.array(online)[settled]),
        "Klipper's filter, 10 Hz": summary(
            np.array(klipper(exchanges))[settled] - (instants_us - zero_us)[settled]
        ),
        "Klipper's filter, 1 Hz": summary(
            (np.array(klipper(slow)) - (instants_us - zero_us)[::10])[settled[::10]]
        ),
    }


def lsl(seconds: float, folder: Path, how: str) -> dict[str, float | str]:
    """A gateway that pushes what arrives, and an inlet that writes lines; the inlet is killed at the end."""
    board, file = PtyBoard(), folder / f"lsl-{how}.csv"
    source = f"impid-bench-{time.monotonic_ns()}"
    programs = [
        subprocess.Popen([sys.executable, "-c", GATEWAY, board.port, source]),
        subprocess.Popen([sys.executable, "-c", INLET, source, str(file), how]),
    ]
    try:
        deadline = time.monotonic() + 60
        while not (file.exists() and file.stat().st_size) and time.monotonic() < deadline:
            time.sleep(0.05)
        time.sleep(seconds)
        ticks = board.ticks
        programs[1].kill()
    finally:
        for program in programs:
            program.kill()
            program.wait()
        board.close()
    lines = file.read_text().splitlines()[:-1]  # the last one may be torn
    stamps, tick = np.array([line.split(",") for line in lines], dtype=float).T
    errors = 1e6 * (stamps - board.clock_zero_s - 1e-3 * tick)
    settled = stamps > stamps[0] + SETTLED_S
    return {**summary(errors[settled]), "missing_after_kill_ms": ticks - int(tick[-1])}


PYTHON_CAN = """
import sys, can
from impid_host.link.can_bus import parse_address
interface, channel, options = parse_address(sys.argv[1])
with can.Bus(interface=interface, channel=channel, **options) as bus, can.Logger(sys.argv[2]) as log:
    print("ready", flush=True)
    for message in bus:
        log(message)
"""


def python_can(seconds: float, folder: Path) -> dict[str, float]:
    """Its Logger in its canutils format, which has microseconds."""
    address, file = free_multicast(), folder / "stamps.log"
    board = CanBoard(bus_at(address))
    logger = subprocess.Popen([sys.executable, "-c", PYTHON_CAN, address, str(file)], stdout=subprocess.PIPE)
    assert logger.stdout is not None
    logger.stdout.readline()
    wall_minus_monotonic_s = time.time() - time.monotonic()
    board.command("START")
    time.sleep(seconds)
    logger.kill()
    logger.wait()
    board.close()
    errors = []
    with can.LogReader(file) as reader:
        for message in reader:
            if message.arbitration_id == ENCODER.frame_id:
                tick = ENCODER.unpack(np.frombuffer(bytes(message.data), "<u8"))["enc1_low28"][0]
                errors.append(
                    message.timestamp - wall_minus_monotonic_s - board.clock_zero_s - 1e-3 * float(tick)
                )
    return summary(1e6 * np.array(errors))


def on_the_model_link(runs: int = 100) -> dict[str, dict[str, float]]:
    """The design's link (bench/clock_sync.py): 150 us and an exponential of 300 us each way, 5 % outliers."""
    rng = np.random.default_rng(1)
    errors: dict[str, list[float]] = {
        "impid-host, offline": [],
        "impid-host, online": [],
        "Klipper's filter, 10 Hz": [],
    }
    for _ in range(runs):
        link = exchanges(rng, 50.0)
        fit, clock = fit_clock(link), OnlineClock()
        errors["impid-host, offline"].append(
            fit.board_us(fit.reference_host_us * 1e3) - board_us(fit.reference_host_us)
        )
        theirs = klipper(link)
        for n, each in enumerate(link):
            clock.add(each)
            if n >= 100 and n % 10 == 0 and (now := clock.estimate()) is not None:
                truth = board_us(each.t4_ns * 1e-3)
                errors["impid-host, online"].append(now.board_us(each.t4_ns) - truth)
                errors["Klipper's filter, 10 Hz"].append(theirs[n] - truth)
    return {name: summary(np.array(values)) for name, values in errors.items()}


def main(seconds: float = 60.0) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        found: dict[str, object] = dict(ours(seconds, folder))
        found["python-can's logger"] = python_can(seconds, folder)
        if importlib.util.find_spec("pylsl") is not None:
            found["LSL, clock corrected"] = lsl(seconds, folder, "plain")
            found["LSL, clock corrected and dejittered"] = lsl(seconds, folder, "dejitter")
    save("stamps", seconds=seconds, recorders=found, model=on_the_model_link())


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
