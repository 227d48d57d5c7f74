"""`impid-host check`: the commonest mistakes of a laboratory, before any number is believed."""

import difflib
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich.console import Console

from impid_host.cli.checked import IMPOSSIBLE, unconfirmed
from impid_host.cli.inputs import load_inputs
from impid_host.errors import InputError
from impid_host.report.wide_console import table_console
from impid_host.study.toml_file import load_toml

if TYPE_CHECKING:
    from impid_host.checks import Change, Checks


@click.command()
@click.argument("study", type=click.Path(path_type=Path))
@click.option(
    "--json", "json_to", metavar="FILE|-", help="Also write the answer as JSON (- for standard output)."
)
@click.option(
    "--fix",
    is_flag=True,
    help="Show what would change in setup.toml, and write it to setup.fixed.toml beside it.",
)
def command(study: Path, json_to: str | None, fix: bool) -> None:
    """Look for mistakes in a study: signs, units, swapped channels, turned sensors, wrong labels.

    Each is tried as a change of the setup, and named only where it explains what nothing else does. Takes
    seconds. Exit status 3 where something is impossible.

    \b
    Examples:
      impid-host check study/
      impid-host check study/ --fix
    """
    read = load_inputs([study], (), None)
    from impid_host.checks import agreement, check_study  # noqa: PLC0415  (slow to import)
    from impid_host.report.check_tables import agreement_table, print_above, print_below  # noqa: PLC0415

    with Console(stderr=True).status("checking"):
        checks = check_study(read)
        pairs = agreement(read)
    if not checks.trusted:
        pairs_shown = None
    else:
        checks = checks.with_more(pairs.checks)
        pairs_shown = pairs
    if json_to != "-":
        console = table_console()
        print_above(console, checks)
        if pairs_shown is not None and pairs_shown.pairs:
            console.print(agreement_table(pairs_shown))
        print_below(console, checks)
        if not len(checks):
            console.print(f"{read.name}: nothing contradicts itself or physics.")
        assumption = unconfirmed(read)
        if assumption:
            console.print(assumption)
    if json_to is not None:
        _write(checks_json(read.name, checks, [pair.to_dict() for pair in pairs.pairs]), json_to)
    if fix:
        write_fixed(study, checks, err=json_to == "-")
    if checks.impossible:
        raise SystemExit(IMPOSSIBLE)


def checks_json(study: str, checks: "Checks", pairs: list[dict[str, Any]]) -> dict[str, Any]:
    """The answer, format impid-check/1."""
    return {"format": "impid-check/1", "study": study, **checks.to_dict(), "agreement": pairs}


def write_fixed(study: Path, checks: "Checks", *, err: bool = False) -> None:
    """Show the difference, and write the corrected setup beside the old one; the old one stays.

    Raises:
        InputError: the study has no setup.toml of its own, or the file cannot be written.
    """
    import tomli_w  # noqa: PLC0415

    path = study / "setup.toml"
    changes = _first_of_each_group(checks)
    if not changes:
        click.echo("--fix: nothing here is mended in setup.toml", err=err)
        return
    tables = load_toml(path)
    before = tomli_w.dumps(tables)
    for change in changes:
        tables.setdefault(change.table, {})[change.key] = change.value
    after = tomli_w.dumps(tables)
    click.echo(
        "".join(
            difflib.unified_diff(
                before.splitlines(keepends=True),
                after.splitlines(keepends=True),
                str(path),
                "setup.fixed.toml",
            )
        ),
        err=err,
    )
    fixed = study / "setup.fixed.toml"
    try:
        fixed.write_text(after, encoding="utf-8")
    except OSError as error:
        raise InputError(
            fixed, f"cannot be written ({error.strerror})", "check permissions and space"
        ) from None
    click.echo(f"{fixed} written; look at it, then: mv {fixed} {path}", err=err)


def _first_of_each_group(checks: "Checks") -> "list[Change]":
    """Of findings that explain the same, only the first: they stand in the order of their likelihood."""
    taken: list[Change] = []
    keys: set[tuple[str, str]] = set()
    for entry in checks:
        if any((change.table, change.key) in keys for change in entry.changes):
            continue
        for change in entry.changes:
            keys.add((change.table, change.key))
            taken.append(change)
    return taken


def _write(document: dict[str, Any], to: str) -> None:
    text = json.dumps(document, indent=2, allow_nan=False)
    if to == "-":
        click.echo(text)
    else:
        Path(to).write_text(text + "\n", encoding="utf-8")
