"""What commands that check a study have in common: exit status, what is assumed, a study that is refused."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import click

from impid_host.errors import UndeterminedError
from impid_host.study.model import Study

if TYPE_CHECKING:
    from impid_host.checks import Checks

IMPOSSIBLE = 3
OFFER = (
    "next: impid-host check {study}   (looks for swapped signs, units and labels before anything is fitted)"
)


def offer_check(study: Path) -> None:
    """The closing line of commands that make a study."""
    click.echo(OFFER.format(study=study), err=True)


def unconfirmed(study: Study) -> str:
    """What nothing in a study can contradict, said once; empty where something would."""
    weighed = any(trial.payload_kg for trial in study.trials)
    measured = any(trial.robot.force is not None for trial in study.trials)
    if weighed or measured or all(trial.kind == "free" for trial in study.trials):
        return ""
    return (
        "Assumed: M, B and K scale with the torque constants; no weighed payload and no force sensor "
        "confirms them."
    )


def refused(study: Study, checks: "Checks", error: UndeterminedError, json_to: str | None) -> NoReturn:
    """A study that cannot be fitted: what the checks found comes before the reason.

    Raises:
        UndeterminedError: the reason; exit status 3 instead where the checks found something impossible.
    """
    if json_to is not None:
        document = {"study": study.name, **checks.to_dict(), "error": str(error)}
        document["trusted"] = False
        text = json.dumps(document, indent=2, allow_nan=False)
        if json_to == "-":
            click.echo(text)
        else:
            Path(json_to).write_text(text + "\n", encoding="utf-8")
    if json_to != "-":
        from impid_host.report.check_tables import print_above  # noqa: PLC0415  (slow to import)
        from impid_host.report.wide_console import table_console  # noqa: PLC0415

        print_above(table_console(), checks)
    reason = after_mistakes(str(error), checks)
    if checks.impossible:
        click.echo(f"impid-host: {reason}", err=True)
        raise SystemExit(IMPOSSIBLE) from None
    raise UndeterminedError(reason) from error


def after_mistakes(reason: str, checks: "Checks") -> str:
    """Why a fit refuses, with the mistakes that were named as what to mend in place of general advice."""
    grave = [one for one in checks if one.verdict != "suspect" and not one.what.endswith("disagree")]
    causes = [one for one in grave if one.what.split(".")[0] not in ("result", "vaf")]
    named = [f"{one.what}@{one.where}" if one.where else one.what for one in causes]
    if not named:
        return reason
    return f"{reason.partition(';')[0]}; mend {' or '.join(named)} first, as said above"
