"""Mutation test of the firmware's hardware code: single mistakes, each built, flashed into the emulator and run.

    .venv/bin/python bench/firmware_mutants.py run --jobs 2 --lists board --markdown docs/validation/mutants.md
    .venv/bin/python bench/firmware_mutants.py run --only DDS
    .venv/bin/python bench/firmware_mutants.py judge .pio/build/nucleo_f446re/firmware.elf nucleo

With `--kept FILE` each verdict is written there at once, and those that are there of the same sources are not
found anew: a run of hours may stop and go on.

A mistake is caught if the binary that has it fails one of the checks in firmware_mutation, or does what the
emulator refuses. Less than 95 % caught, or a survivor that the list does not explain, is a failure (exit status 1).
"""

import hashlib
import json
import signal
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue
from tempfile import TemporaryDirectory

import click
from firmware_mutation.checks import CHECKS, first_failure
from firmware_mutation.mutants import COPIED, ROOT, Mutant, MutantError, Workshop, mutants

from hil_sim.board.elf.wiring import CUSTOM, NUCLEO

WIRINGS = {"nucleo": NUCLEO, "custom": CUSTOM}
LIMIT_S = 60  # of processor time: a binary that keeps the emulator busy for longer does not do its work
REQUIRED = 0.95


@click.group()
def main() -> None:
    """Mistakes put into the firmware one by one."""


@main.command()
@click.argument("image", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.argument("board", type=click.Choice(list(WIRINGS)))
@click.option("--of-list", default="", help="The checks for the mistakes of this list first.")
def judge(image: Path, board: str, of_list: str) -> None:
    """Prints the first check that a binary fails; exit status 1 if there is one."""
    failure = first_failure(image, WIRINGS[board], of_list)
    print(failure or f"passes all {len(CHECKS)} checks")
    sys.exit(failure is not None)


def verdict(image: Path, board: str, of_list: str) -> str | None:
    """As first_failure, in a process of its own that may hang."""
    done = subprocess.run(
        ["prlimit", f"--cpu={LIMIT_S}", sys.executable, __file__, "judge", image, board, "--of-list", of_list],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return f"hangs: not through its checks after {LIMIT_S} s of processor time"
    if not done.stdout:
        raise MutantError(f"the checks themselves went wrong: {done.stderr.strip()[-400:]}")
    return done.stdout.strip() if done.returncode else None


class Verdicts:
    """What has been found so far, in a file of JSON lines; without a file, nothing."""

    def __init__(self, file: Path | None) -> None:
        self._file = file
        rows = file.read_text(encoding="utf-8").splitlines() if file is not None and file.exists() else []
        self._found: dict[str, str | None] = dict(json.loads(row) for row in rows)
        sources = sorted(path for name in COPIED for path in (ROOT / name, *(ROOT / name).rglob("*.[chl]*")))
        self._sources = hashlib.sha256(b"".join(path.read_bytes() for path in sources if path.is_file()))

    def _key(self, mutant: Mutant) -> str:
        digest = self._sources.copy()
        digest.update(repr((mutant.file, mutant.old, mutant.new, mutant.board)).encode())
        return digest.hexdigest()

    def of(self, mutant: Mutant, find: Callable[[Mutant], str | None]) -> str | None:
        """As kept, or as found now."""
        key = self._key(mutant)
        if key not in self._found:
            self._found[key] = find(mutant)
            if self._file is not None:
                self._file.parent.mkdir(parents=True, exist_ok=True)
                with self._file.open("a", encoding="utf-8") as out:
                    out.write(json.dumps([key, self._found[key]]) + "\n")
        return self._found[key]


@main.command()
@click.option("--jobs", default=1, show_default=True, help="Binaries at a time.")
@click.option("--only", default="", help="Mistakes whose description or file contains this.")
@click.option("--lists", default="", help="Lists whose file name contains this, e.g. life.")
@click.option("--markdown", type=click.Path(dir_okay=False, path_type=Path), help="Where the table goes.")
@click.option("--kept", type=click.Path(dir_okay=False, path_type=Path), help="Where verdicts are kept.")
def run(jobs: int, only: str, lists: str, markdown: Path | None, kept: Path | None) -> None:
    """Builds and judges every mistake, and the firmware without any."""
    chosen = [mutant for mutant in mutants(lists) if only in mutant.what or only in mutant.file]
    whole = [
        Mutant("no mistake", "boards/stm32/main.c", "int main(void)", "int main(void)", b) for b in WIRINGS
    ]
    verdicts = Verdicts(kept)
    workshops: Queue[Workshop] = Queue()
    with TemporaryDirectory() as folder:
        for number in range(jobs):
            workshops.put(Workshop(Path(folder, str(number))))

        def find(mutant: Mutant) -> str | None:
            workshop = workshops.get()
            try:
                return verdict(workshop.build(mutant), mutant.board, mutant.of_list)
            finally:
                workshops.put(workshop)

        def examine(mutant: Mutant) -> str | None:
            failure = verdicts.of(mutant, find)
            print(f"{mutant.what}: {failure or 'survives'}", flush=True)
            return failure

        with ThreadPoolExecutor(jobs) as pool:
            try:
                results = list(pool.map(examine, whole + chosen))
            except MutantError as error:
                pool.shutdown(cancel_futures=True)
                raise click.ClickException(str(error)) from error
    if any(results[: len(whole)]):
        raise click.ClickException(f"the firmware without a mistake fails: {results[: len(whole)]}")
    found = dict(zip(chosen, results[len(whole) :], strict=True))
    if markdown:
        command = f"run --jobs {jobs}{f' --lists {lists}' if lists else ''} --markdown {markdown}"
        markdown.write_text(page(found, command), encoding="utf-8")
    caught = sum(failure is not None for failure in found.values())
    unexplained = [m.what for m, failure in found.items() if failure is None and not m.harmless]
    print(f"{caught} of {len(found)} caught ({100 * caught / len(found):.1f} %)")
    if caught < REQUIRED * len(found) or unexplained:
        raise click.ClickException(f"survivors without an explanation: {unexplained}")


def page(found: dict[Mutant, str | None], command: str) -> str:
    """The result in Markdown."""
    caught = [m for m, failure in found.items() if failure is not None]
    lists = sorted({m.of_list for m in found})
    survivors = [m for m, failure in found.items() if failure is None]
    lines = [
        "# Mistakes put into the firmware",
        "",
        f"{len(found)} single mistakes (`bench/firmware_mutation/{' and '.join(f'{n}.toml' for n in lists)}`),",
        "each built as what ships and run in the emulator:",
        f"**{len(caught)} caught, {100 * len(caught) / len(found):.1f} %** (required: {100 * REQUIRED:g} %).",
        f"The firmware without a mistake passes all {len(CHECKS)} checks on both boards.",
        "",
        f"Command: `.venv/bin/python bench/firmware_mutants.py {command}`",
        "",
        "## Not caught",
        "",
        "| mistake | file | why nothing shows it |",
        "| --- | --- | --- |",
        *(f"| {m.what} | `{m.file}` | {m.harmless or 'NOT EXPLAINED'} |" for m in survivors),
        "",
        "## Caught",
        "",
        "| mistake | file | by |",
        "| --- | --- | --- |",
        *(f"| {m.what} | `{m.file}` | {cell(found[m])} |" for m in caught),
        "",
    ]
    return "\n".join(lines)


def cell(failure: str | None) -> str:
    """A text that stands in a table: one line, not too long."""
    text = (failure or "").replace("|", "\\|").replace("\n", " ")
    return text if len(text) <= 160 else text[:157] + "..."


if __name__ == "__main__":
    main()
