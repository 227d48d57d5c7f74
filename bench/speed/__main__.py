"""`python -m bench.speed [--out PAGE] [--only PART]`: every row beside its peer, the curves, the machine."""

import argparse
import os
import platform
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import elf_speed
import numpy as np

from speed import commands, fits, joints, recordings, wire
from speed.measure import Job, cost

HEAD = """# Speed and memory

`{command}`: processor time of one thread, unless a row says otherwise, in a process of its own, preparation and imports not
counted, peers in the same run on the same data. Ratio: ours over the peer's, of rates; the peer's over ours, of times: above 1 is
faster than the peer. {machine}; load average {load} while it ran, {minutes:.0f} minutes. What shares a core with others is slower
by caches that it shares; the ratios are steadier than the figures.

"""


@dataclass(frozen=True)
class Row:
    """What was measured, in words; ratio: above 1 is better than the peer."""

    what: str
    ours: str
    peer: str = ""
    ratio: float | None = None
    goal: str = ""

    def line(self) -> str:
        """Of the table."""
        ratio = "" if self.ratio is None else f"{self.ratio:.2g}"
        return f"| {self.what} | {self.ours} | {self.peer} | {ratio} | {self.goal} |"


def decoding() -> list[Row]:
    """Samples a second, serial and CAN."""
    loop, numpy, memory = (
        cost(job, times=2).rate for job in (wire.serial_loop, wire.serial_numpy, wire.memory)
    )
    rows = []
    for piece, words in ((1 << 20, "1 MiB"), (4096, "4 KiB")):
        ours = cost(wire.serial, piece, times=2).rate
        what = f"serial decode, pieces of {words}"
        goal = "12 M and 10 loops in numpy, 40 M with the extension"
        rows.append(Row(what, _millions(ours), f"struct loop {_millions(loop)}", ours / loop, goal))
        rows.append(Row("", "", f"numpy, nothing checked {_millions(numpy)}", ours / numpy))
    rows.append(Row("", "", f"memory copied {_millions(memory)}", ours / memory))
    ours, loop, blf = (cost(job, times=2).rate for job in (wire.can_ours, wire.can_loop, wire.can_blf))
    rows.append(Row("CAN decode", _millions(ours), f"struct loop {_millions(loop)}", ours / loop, "20 M"))
    rows.append(Row("", "", f"python-can BLF {_millions(blf)}", ours / blf))
    return rows


def recorded() -> list[Row]:
    """Opening and size of a recording, the recorder's share of a core."""
    blf = cost(recordings.opened_blf)
    blf_size, blf_hours = blf.about
    rows = []
    for carrier, raw in (("serial", 3600 * 18.6 / 1e3), ("can", None)):
        ours = cost(recordings.opened, carrier, HOURS)
        per_hour, size = ours.cpu_s / HOURS, ours.about[0] / HOURS
        their = blf.cpu_s / blf_hours
        what = f"open a recording, {carrier}, an hour (from {HOURS:g} h)"
        peer = f"python-can BLF {their:.1f} s"
        rows.append(
            Row(
                what,
                f"{per_hour:.1f} s; {ours.peak_MB:.0f} MB for {HOURS:g} h",
                peer,
                their / per_hour,
                "1 s, 300 MB",
            )
        )
        beside = blf_size / blf_hours if raw is None else raw
        name = "BLF" if raw is None else "raw bytes"
        rows.append(
            Row("its size", f"{size:.0f} MB/h", f"{name} {beside:.0f} MB/h", beside / size, "80 MB/h")
        )
    for kind, goal in (("serial", "5 %"), ("slcan", "8 %")):
        share = recordings.share(kind, RECORD_S)
        rows.append(Row(f"record at 1 kHz, {kind}, share of a core", f"{100 * share:.1f} %", goal=goal))
    return rows


def fitted() -> list[Row]:
    """Fits, diagnoses, clock matching."""
    plain = cost(fits.scipy_alone, times=2).cpu_s
    one = cost(fits.fit, *fits.ONE, times=2)
    rows = [
        Row(
            "fit, one trial of 50 s",
            _seconds(one),
            f"scipy, no clocks, no intervals {plain:.3f} s",
            plain / one.cpu_s,
            "0.15 s",
        )
    ]
    for words, job, size, goal in (
        ("fit, 75 trials of 50 s", fits.fit, (15, 4, 15, 50.0), "8 s on two cores"),
        ("diagnose, 8 trials of 50 s", fits.diagnose, (4, 2, 2, 50.0), "10 s, 500 MB"),
        ("diagnose, 16 trials of 50 s", fits.diagnose, (4, 4, 3, 50.0), "20 s, 700 MB"),
    ):
        rows.append(Row(words, _seconds(cost(job, *size)), goal=goal))
    rows.append(Row("match the clocks of a trial of 50 s", f"{cost(fits.match, 4).cpu_s / 4:.2f} s"))
    return rows


def started() -> list[Row]:
    """Commands that have nothing to do."""
    bare = commands.bare()
    ours = commands.started("--help")
    rows = [Row("`impid-host --help`", f"{ours:.2f} s", f"bare Python {bare:.3f} s", bare / ours, "0.35 s")]
    for arguments in commands.STARTS:
        spent = commands.started(*arguments)
        rows.append(Row(f"start of `{arguments[0]}`", f"{spent:.2f} s", goal="0.6 s"))
    return rows


def emulated() -> list[Row]:
    """The shipping binary against real time, where it is built."""
    if not elf_speed.DEFAULT.exists():
        return [Row("ELF emulator", "not measured: `make firmware` builds the binary", goal="10 x")]
    return [
        Row(
            f"ELF emulator, {carrier}",
            f"{elf_speed.speed(elf_speed.DEFAULT, carrier, 5.0)[1]:.1f} x real time",
            goal="10 x",
        )
        for carrier in ("serial", "can")
    ]


def curves() -> list[str]:
    """How time and memory grow; the exponent is that of time, over the last factor of two or more."""
    found = [
        _curve(
            "samples",
            "`fit`, one free trial",
            fits.fit,
            [(1, 0, 0, s) for s in (12.5, 25.0, 50.0, 100.0, 200.0)],
            by_about=True,
        ),
        _curve(
            "trials",
            "`fit`, trials of 20 s",
            fits.fit,
            [(n, 1, n, 20.0) for n in (1, 2, 4, 8, 16)],
            count=lambda a: 2 * a[0],
        ),
        _curve("joints", "`fit`, two trials of 40 s of a chain", joints.fit, [(n,) for n in (2, 3, 4, 6, 7)]),
        _curve(
            "effects hidden",
            "`diagnose`, 4 trials of 30 s",
            fits.diagnose_hidden,
            [([*HIDDEN[:n]],) for n in range(4)],
            by_about=True,
        ),
    ]
    return [line for curve in found for line in curve]


HOURS = 0.1
RECORD_S = 15.0
HIDDEN = ("elastic.cartesian@tip", "actuator.offset@joint1", "friction.coulomb@joint2")


def _curve(
    against: str,
    what: str,
    job: Job,
    sizes: list[tuple[Any, ...]],
    *,
    by_about: bool = False,
    count: Callable[[tuple[Any, ...]], object] = lambda size: size[0],
) -> list[str]:
    costs = [cost(job, *size) for size in sizes]
    at = [own.about if by_about else count(size) for own, size in zip(costs, sizes, strict=True)]
    lines = [f"### {what}", "", f"| {against} | processor time, s | peak memory, MB |", "| --- | --- | --- |"]
    lines += [
        f"| {number} | {own.cpu_s:.2f} | {own.peak_MB:.0f} |" for number, own in zip(at, costs, strict=True)
    ]
    if float(at[-2]) > 0:  # type: ignore[arg-type]
        grown = np.log(costs[-1].cpu_s / costs[-2].cpu_s) / np.log(float(at[-1]) / float(at[-2]))  # type: ignore[arg-type]
        lines += ["", f"Exponent of time at the end of the curve: {grown:.2f}."]
    print("\n".join(lines), "\n", flush=True)
    return [*lines, ""]


def _millions(rate: float) -> str:
    return f"{rate / 1e6:.3g} M/s"


def _seconds(own: object) -> str:
    return f"{own.cpu_s:.2f} s ({own.wall_s:.1f} s of wall), {own.peak_MB:.0f} MB"  # type: ignore[attr-defined]


def machine() -> str:
    """What this runs on."""
    info = Path("/proc/cpuinfo")
    names = [
        line.partition(":")[2].strip()
        for line in info.read_text().splitlines()
        if line.startswith("model name")
    ]
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    cpu = f"{os.cpu_count()} cores of {names[0] if names else platform.processor()}"
    return f"{cpu}, {memory:.0f} GiB, {platform.system()}, Python {platform.python_version()}, numpy {np.__version__}"


PARTS = {
    "decoding": decoding,
    "recorded": recorded,
    "fitted": fitted,
    "started": started,
    "emulated": emulated,
}


def main() -> None:
    """Print the table as it grows; write the page where one is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, help="the page, docs/validation/bench.md say")
    parser.add_argument("--only", choices=[*PARTS, "curves"], help="one part, for a look")
    asked = parser.parse_args()
    begin, loads = time.monotonic(), [os.getloadavg()[0]]
    lines = ["| what | impid | peer | ratio | goal |", "| --- | --- | --- | --- | --- |"]
    print("\n".join(lines), flush=True)
    for name, part in PARTS.items():
        if asked.only in (None, name):
            rows = [row.line() for row in part()]
            print("\n".join(rows), flush=True)
            lines += rows
            loads.append(os.getloadavg()[0])
    if asked.only in (None, "curves"):
        lines += ["", "## How it grows", "", *curves()]
        loads.append(os.getloadavg()[0])
    if asked.out is not None:
        head = HEAD.format(
            command="make bench",
            machine=machine(),
            load=f"{min(loads):.0f} to {max(loads):.0f}",
            minutes=(time.monotonic() - begin) / 60,
        )
        asked.out.write_text(head + "\n".join(lines).rstrip() + "\n", encoding="utf-8")
        print(f"{asked.out} written", file=sys.stderr)


if __name__ == "__main__":
    main()
