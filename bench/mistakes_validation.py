"""Validation of `check`: every mistake in random laboratories, and studies without one.

    python bench/mistakes_validation.py run mistakes.jsonl --first-seed 7500
    python bench/mistakes_validation.py table mistakes.jsonl --markdown docs/validation/mistakes.md

One line of JSON per study; what is in the file is not run again.
"""

import json
import os
import warnings
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import click
from impid_host.checks import agreement, check_study
from mistakes_campaign.laboratories import KINDS, in_order, laboratory
from mistakes_campaign.mistakes import MISTAKES
from mistakes_campaign.page import page

FILE = click.Path(dir_okay=False, path_type=Path)
MARK = "<!-- from here on written by bench/mistakes_validation.py -->"
CLEAN_OFFSET = 100


@click.group()
def main() -> None:
    """The campaign and its table."""


@main.command()
@click.argument("out", type=FILE)
@click.option("--first-seed", type=int, required=True, help="Of the laboratories with mistakes.")
@click.option("--laboratories", default=5, show_default=True, help="How many, each with every mistake.")
@click.option("--clean", default=200, show_default=True, help="Studies without a mistake.")
def run(out: Path, first_seed: int, laboratories: int, clean: int) -> None:
    """Make the studies, check them, and write what was said."""
    known = {(line["seed"], line["mistake"]) for line in read(out)} if out.exists() else set()
    with out.open("a", encoding="utf-8") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for seed in range(first_seed, first_seed + laboratories):
            wanted = [m for m in MISTAKES if (seed, m.name) not in known]
            if not wanted:
                continue
            kind = KINDS[seed % len(KINDS)]
            study, _ = laboratory(seed, kind)
            for mistake in wanted:
                if mistake.needs(study):
                    found = _said(mistake.change(study))
                    _write(file, {"seed": seed, "kind": kind.name, "mistake": mistake.name, **found})
        for seed in range(first_seed + CLEAN_OFFSET, first_seed + CLEAN_OFFSET + clean):
            if (seed, "") not in known:
                study, what = in_order(seed)
                _write(file, {"seed": seed, "kind": what, "mistake": "", **_said(study, pairs=True)})


def _said(study: Any, *, pairs: bool = False) -> dict[str, Any]:
    checks = check_study(study)
    if pairs:
        checks = checks.with_more(agreement(study).checks)
    return {"said": [[one.what, one.where, one.verdict] for one in checks]}


def _write(file: Any, line: dict[str, Any]) -> None:
    file.write(json.dumps(line) + "\n")
    file.flush()


@main.command()
@click.argument("lines", type=FILE)
@click.option("--markdown", type=FILE, required=True)
@click.option("--command", default="", help="The command of the run, for the page.")
def table(lines: Path, markdown: Path, command: str) -> None:
    """Write the tables below the words that a page has already."""
    head = markdown.read_text(encoding="utf-8").partition(MARK)[0] if markdown.exists() else ""
    markdown.write_text(f"{head}{MARK}\n\n{page(read(lines), command)}", encoding="utf-8")


def read(path: Path) -> list[dict[str, Any]]:
    """The lines of a campaign."""
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


if __name__ == "__main__":
    main()
