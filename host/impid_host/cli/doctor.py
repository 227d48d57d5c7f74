"""`impid-host doctor`: is this desk ready to measure?"""

import json
from dataclasses import asdict
from pathlib import Path

import click

from impid_host.cli.link_options import address_of, link_options

_SIGNS = {"good": ("ok  ", "green"), "look": ("look", "yellow"), "bad": ("BAD ", "red")}


@click.command()
@link_options
@click.option(
    "--folder",
    type=click.Path(path_type=Path),
    default=Path(),
    help="Where recordings go. Default: the current folder.",
)
@click.option("--json", "as_json", is_flag=True, help="For programs.")
def command(*, port: str | None, can: str | None, baud: int | None, folder: Path, as_json: bool) -> None:
    """Ports, permissions, board, versions, clock, disk: what is not right, and what to do.

    Exit status 1 where something would spoil a recording.

    \b
    Examples:
      impid-host doctor
      impid-host doctor --port /dev/ttyACM0 --folder /data
    """
    from impid_host.desk.doctor import examine  # noqa: PLC0415

    named = port is not None or can is not None
    findings = []
    for finding in examine(address_of(port, can, baud) if named else None, folder):
        findings.append(finding)
        if not as_json:
            sign, colour = _SIGNS[finding.state]
            shown = click.style(sign, fg=colour, bold=finding.state == "bad")
            click.echo(f"{shown}  {finding.what:9}{finding.words}")
            if finding.remedy:
                click.echo(f"      {'':9}-> {finding.remedy}")
    if as_json:
        click.echo(
            json.dumps({"format": "impid-doctor/1", "findings": [asdict(own) for own in findings]}, indent=2)
        )
    if any(finding.state == "bad" for finding in findings):
        raise SystemExit(1)
