"""`impid-host report`: one page about a study, for people who were not there."""

import sys
from pathlib import Path

import click
from rich.console import Console

from impid_host.errors import InputError


@click.command()
@click.argument("studies", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="STUDY...")
@click.option(
    "--out",
    type=click.Path(path_type=Path, dir_okay=False),
    default=Path("report.html"),
    show_default=True,
    help="The page, one file.",
)
@click.option(
    "--figures",
    type=click.Path(path_type=Path, file_okay=False),
    help="Also write its figures as PDF and SVG of a journal column's width to this folder.",
)
@click.option(
    "--diagnose/--no-diagnose",
    "diagnosed",
    default=True,
    show_default=True,
    help="Look for what the first model lacks; takes a minute or so for each study.",
)
def command(studies: tuple[Path, ...], out: Path, figures: Path | None, diagnosed: bool) -> None:
    """Write one HTML page: verdict, checks, tables, residuals, effects, ellipses, forces, data, provenance.

    The page opens without a network and prints; its figures can be zoomed. What `check`, `fit` and `diagnose`
    say stands in it as they say it (docs/report.md tells how to read it). Exit status 3 where something is
    impossible; the page is written all the same, and says so at its top.

    \b
    Examples:
      impid-host report study/
      impid-host report study/ --out report.html --figures figures/
      impid-host report monday/ tuesday/ --out both.html
    """
    from impid_host.cli.checked import IMPOSSIBLE  # noqa: PLC0415  (what follows is slow to import)
    from impid_host.cli.inputs import load_studies  # noqa: PLC0415

    read = load_studies(studies)
    from impid_host.report.page.findings import gather  # noqa: PLC0415  (the catalogue is slow to import)
    from impid_host.report.page.write import figures as plots_of  # noqa: PLC0415
    from impid_host.report.page.write import write_page  # noqa: PLC0415
    from impid_host.sessions.shown import comparison_sections  # noqa: PLC0415

    with Console(stderr=True).status("checking") as status:
        found = [gather(study, status.update, diagnosed=diagnosed) for study in read]
        status.update("writing")
        page = write_page(found, ["impid-host", *sys.argv[1:]], comparison_sections(found))
        drawn = 0
        if figures is not None:
            from impid_host.report.page.journal import draw  # noqa: PLC0415  (matplotlib is slow to import)

            for own in found:
                place = figures / own.study.name.replace("/", "_") if len(found) > 1 else figures
                drawn += len(draw(plots_of(own), place))
    write_text(out, page)
    click.echo(f"{out}: {len(page) / 1e6:.1f} MB" + (f"; {drawn} figures in {figures}" if drawn else ""))
    for own in found:
        click.echo(f"{own.study.name}: {own.verdict}")
    if any(own.checks.impossible for own in found):
        raise SystemExit(IMPOSSIBLE)


def write_text(path: Path, text: str) -> None:
    """Write a result, or say in one line why not.

    Raises:
        InputError: the file cannot be written.
    """
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(path, f"cannot be written ({error.strerror})", "choose another place") from None
