"""Validation of `diagnose` on random laboratories: every effect, effects in company, none, and unknown ones.

    python bench/diagnosis_validation.py run campaign.jsonl --first-seed 200000 --jobs 2
    python bench/diagnosis_validation.py table campaign.jsonl --markdown table.md --json table.json

One line of JSON per study; studies that are in the file already are not run again, so that a campaign may be
interrupted. They come in an order that makes an interrupted campaign a smaller one.
"""

import json
import os
import signal
import subprocess
import time
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from multiprocessing import get_context
from pathlib import Path
from typing import Any

# Two studies at a time fill two cores; threads within each would only get in the way. Must precede numpy.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import click
from diagnosis_campaign.cases import STRENGTHS, Case, Sizes, plan
from diagnosis_campaign.diagram import draw
from diagnosis_campaign.page import page
from diagnosis_campaign.run import run as run_case
from diagnosis_campaign.tally import summary

FILE = click.Path(dir_okay=False, path_type=Path)
MARK = "<!-- from here on written by bench/diagnosis_validation.py -->"


@click.group()
def main() -> None:
    """Campaigns of random studies, and their tables."""


@main.command()
@click.argument("out", type=FILE)
@click.option("--first-seed", type=int, required=True, help="Of the campaign; each study has its own.")
@click.option("--each", default=3, show_default=True, help="Studies per known effect and strength.")
@click.option("--together", default=54, show_default=True, help="Studies with two or three effects.")
@click.option("--outside", default=5, show_default=True, help="Studies per effect outside the catalogue.")
@click.option("--clean", default=125, show_default=True, help="Studies with nothing hidden.")
@click.option("--when", default=2, show_default=True, help="Studies per effect in one kind of trials only.")
@click.option("--situations", default=4, show_default=True, help="Studies per case made by hand.")
@click.option("--strength", "strengths", type=float, multiple=True, default=STRENGTHS, show_default=True)
@click.option("--only", default="", help="Those whose effects or part contain this word.")
@click.option("--seed", "seeds", type=int, multiple=True, help="Those with these seeds; may be repeated.")
@click.option("--jobs", default=1, show_default=True, help="Studies at a time.")
@click.option("--until", help="Begin no study after this local time, HH:MM.")
def run(
    out: Path,
    first_seed: int,
    each: int,
    together: int,
    outside: int,
    clean: int,
    when: int,
    situations: int,
    strengths: tuple[float, ...],
    only: str,
    seeds: tuple[int, ...],
    jobs: int,
    until: str | None,
) -> None:
    """Run the studies of a campaign that OUT does not have yet."""
    cases = plan(first_seed, Sizes(each, together, outside, clean, strengths, when, situations))
    cases = [case for case in cases if only in case.part or any(only in name for name in case.effects)]
    cases = [case for case in cases if not seeds or case.seed in seeds]
    done = {line["seed"] for line in read(out)} if out.exists() else set()
    todo = [case for case in cases if case.seed not in done]
    click.echo(f"{len(todo)} studies to run, {len(cases) - len(todo)} are there")
    code = version()
    whole = not out.exists() or out.read_bytes()[-1:] in (b"", b"\n")
    with out.open("a", encoding="utf-8") as file:
        file.write("" if whole else "\n")
        begin = time.monotonic()
        for count, line in enumerate(carried_out(todo, jobs, until), start=1):
            file.write(json.dumps({**line, "version": code}) + "\n")
            file.flush()
            left = (time.monotonic() - begin) / count * (len(todo) - count) / 60
            found = " + ".join(line.get("found", [line.get("error", "")])) or "nothing"
            hidden = " + ".join(line["effects"]) or f"nothing ({line['noise']})"
            click.echo(
                f"{count}/{len(todo)} {left:.0f} min | {line['seed']} {line['strength']:g} {hidden}"
                f" | {line['verdict']} | {found}"
            )


@main.command()
@click.argument("lines", type=FILE, nargs=-1, required=True)
@click.option("--command", "made_by", default="", help="That made the lines; shown on the page.")
@click.option("--markdown", type=FILE, help="Page whose tables to replace; left out: the screen.")
@click.option("--json", "json_file", type=FILE, help="Where to write the numbers.")
@click.option("--diagram", type=FILE, help="Where to draw how often names were right, by confidence.")
def table(
    lines: tuple[Path, ...], made_by: str, markdown: Path | None, json_file: Path | None, diagram: Path | None
) -> None:
    """Rates with their intervals, errors before and after, and every failure."""
    numbers = summary([line for path in lines for line in read(path)])
    text = page(numbers, made_by or "python bench/diagnosis_validation.py run ...")
    if diagram is not None:
        draw(numbers["reliability"], diagram)
    if markdown is None:
        click.echo(text)
    else:
        words = markdown.read_text(encoding="utf-8").partition(MARK)[0] if markdown.exists() else ""
        markdown.write_text(f"{words}{MARK}\n\n{text}", encoding="utf-8")
    if json_file is not None:
        json_file.write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")


def carried_out(cases: list[Case], jobs: int, until: str | None) -> Any:
    """Yields lines as they are ready; no more are begun than run, so that an end comes soon."""
    fresh = get_context("spawn")  # a fork would inherit locks that threads of this process hold
    ignore = (signal.SIGINT, signal.SIG_IGN)
    with ProcessPoolExecutor(jobs, fresh, initializer=signal.signal, initargs=ignore) as pool:
        waiting = iter(cases)
        running: set[Future[dict[str, Any]]] = set()
        while True:
            while len(running) < jobs and not _over(until):
                case = next(waiting, None)
                if case is None:
                    break
                running.add(pool.submit(run_case, case))
            if not running:
                return
            ready, running = wait(running, return_when=FIRST_COMPLETED)
            for future in ready:
                yield future.result()


def version() -> str:
    """The commit that is checked out, with `-dirty` where files differ from it; empty outside a checkout."""
    git = [
        "git",
        "-C",
        str(Path(__file__).resolve().parent),
        "describe",
        "--always",
        "--dirty",
        "--exclude=*",
    ]
    try:
        return subprocess.run(git, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""


def _over(until: str | None) -> bool:
    return until is not None and time.strftime("%H:%M") >= until


def read(path: Path) -> list[dict[str, Any]]:
    """The lines of a file; a last one that was cut off is run again."""
    result = []
    for text in path.read_text(encoding="utf-8").splitlines():
        try:
            result.append(json.loads(text))
        except json.JSONDecodeError:
            continue
    return result


if __name__ == "__main__":
    main()
