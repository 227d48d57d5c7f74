"""The report: one page that a stranger can send back."""

import platform
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import version

from impid_host.bring_up.result import Result
from impid_host.link.board_info import BoardInfo, build_name


def heading(board: BoardInfo) -> list[str]:
    """Which board, which firmware, which program."""
    return [
        "# Bench test of an impid board",
        "",
        f"- board: unique id {board.uid_0:08x}-{board.uid_1:08x}-{board.uid_2:08x}, "
        f"kind {board.board_id or 0:08x}, boot {board.boot_id}",
        f"- firmware: {build_name(board)}",
        f"- program: impid-host {version('impid')}, Python {platform.python_version()}, {platform.system()}",
        f"- begun: {datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
        "",
        "| what | measured | bound | verdict | detail |",
        "| --- | --- | --- | --- | --- |",
    ]


def row(result: Result) -> str:
    """A line of the table."""
    number = "" if result.value is None else f"{result.value:.4g} {result.unit}".strip()
    return f"| {result.what} | {number} | {result.bound} | {result.verdict} | {result.detail} |"


def closing(results: Sequence[Result]) -> list[str]:
    """The sum, and what a real chip tells that the emulator could not."""
    count = {verdict: sum(r.passed is verdict for r in results) for verdict in (True, False, None)}
    told = [f"- {r.what}: {r.silicon}." for r in results if r.silicon]
    return [
        "",
        f"**{count[True]} ok, {count[False]} out of bound, {count[None]} not measured.**",
        "",
        "## What only silicon can tell",
        "",
        "The firmware has run in an emulator before; there these rows say less:",
        "",
        *dict.fromkeys(told),
        "",
    ]
