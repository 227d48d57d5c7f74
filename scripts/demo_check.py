"""Hold the demo's result against the simulator's truth; exit status 1 if a goal is missed."""

import json
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console
from rich.table import Table


class Check(NamedTuple):
    """One line of the table: `error` is in the unit of `goal`, and no larger than it when all is well."""

    what: str
    truth: str
    found: str
    error: float
    goal: float
    unit: str

    @property
    def reached(self) -> bool:
        return self.error <= self.goal


def percent(what: str, truth: float, found: float, goal: float) -> Check:
    """Relative error of a parameter."""
    error = 100 * abs(found - truth) / abs(truth)
    return Check(what, f"{truth:.5g}", f"{found:.5g}", error, goal, "%")


def vaf_checks(owner: str, vafs: dict[str, float]) -> Iterator[Check]:
    """VAF above 98 % on held-out data."""
    for channel, vaf in vafs.items():
        yield Check(f"{owner} VAF of {channel}", "", f"{vaf:.2f} %", 100 - vaf, 2.0, "%")


def robot_checks(fit: dict[str, Any], truth: dict[str, Any]) -> Iterator[Check]:
    """Robot parameters within 2 %."""
    for number, value in enumerate(truth["robot"]["alpha"], start=1):
        name = f"alpha{number}"
        yield percent(name, value, fit["robot"]["parameters"][name]["value"], 2.0)
    yield from vaf_checks("robot", fit["robot"]["vaf"])


def load_checks(name: str, found: dict[str, Any], truth: dict[str, Any]) -> Iterator[Check]:
    """Payload and stiffness within 3 %, by the virtual sensor."""
    M, K = found["M"]["value"], found["K"]["value"]
    yield percent(f"{name} m", truth["M"][0][0], M[0][0], 3.0)
    yield percent(f"{name} kxx", truth["K"][0][0], K[0][0], 3.0)
    yield percent(f"{name} kyy", truth["K"][1][1], K[1][1], 3.0)
    # The off-diagonal entry may be almost nothing: its error is measured against the whole matrix.
    norm = math.sqrt(sum(entry**2 for row in truth["K"] for entry in row))
    ks, true_ks = K[0][1], truth["K"][0][1]
    yield Check(f"{name} ks", f"{true_ks:.5g}", f"{ks:.5g}", 100 * abs(ks - true_ks) / norm, 3.0, "% of |K|")
    yield from vaf_checks(name, found["vaf"])


def clock_check(sync: dict[str, Any], truth: dict[str, Any]) -> Check:
    """Board-to-robot offset within 5 us: where the robot's reference instant lies on the board's clock."""
    clock = truth["clock"]
    rate = 1 + 1e-6 * clock["drift_ppm"]
    on_robot = clock["robot_s_at_board_zero"] + sync["device_ref_s"] * rate
    error_us = 1e6 * abs(sync["robot_ref_s"] - on_robot)
    return Check(f"{sync['name']} offset", "", f"{sync['offset_s']:.7f} s", error_us, 5.0, "us")


def main(out: Path) -> int:
    """Print every figure beside its goal."""
    fit = json.loads((out / "fit.json").read_text())
    sync = json.loads((out / "sync.json").read_text())
    truths = {path.stem: json.loads(path.read_text()) for path in sorted((out / "truth").glob("*.json"))}

    checks = list(robot_checks(fit, next(iter(truths.values()))))
    for name, load in fit["loads"].items():
        trial = next(t["trials"][key] for key, t in truths.items() if key.startswith(name))
        checks += load_checks(name, load["method1"], trial["load"])
    checks += [clock_check(row, truths[row["name"]]["trials"][row["name"]]) for row in sync["trials"]]

    table = Table("", "truth", "found", "error", "goal", "", title="found against truth")
    for check in checks:
        verdict = "ok" if check.reached else "MISSED"
        table.add_row(
            check.what,
            check.truth,
            check.found,
            f"{check.error:.3g} {check.unit}",
            f"{check.goal:g}",
            verdict,
        )
    Console(width=100).print(table)
    return 0 if all(check.reached for check in checks) else 1


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
