"""Set what the simulator hid beside what the diagnosis named; exit status 1 unless every cause was found."""

import json
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table


def places(where: str | list[str]) -> str:
    """`where` is one place or a list of them."""
    return where if isinstance(where, str) else ", ".join(sorted(where))


def main(truth_file: Path, diagnosis_file: Path) -> int:
    """Print both lists side by side."""
    hidden = json.loads(truth_file.read_text())["effects"]
    stages = json.loads(diagnosis_file.read_text())["stages"]
    found = {(stage["added"]["effect"], places(stage["added"]["where"])) for stage in stages[1:]}
    causes = [(effect["effect"], places(effect["where"])) for effect in hidden]

    table = Table("hidden in the simulator", "where", "diagnosed")
    for name, where in causes:
        table.add_row(name, where, "found" if (name, where) in found else "MISSED")
    for name, where in sorted(found - set(causes)):
        table.add_row("(nothing)", where, f"FALSE: {name}")
    Console(width=100).print(table)
    return 0 if found == set(causes) else 1


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2])))
