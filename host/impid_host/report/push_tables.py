"""Pushes as tables: where they are, and what the numbers are without them."""

from collections.abc import Iterator, Sequence
from itertools import chain

from rich.table import Table

from impid_host.checks.pushes import MARGIN_S, Pushes
from impid_host.impedance.campaign import StudyFit
from impid_host.impedance.identify import RobotFit
from impid_host.report.fit_tables import METHODS, number, plus_minus
from impid_host.report.parameter_entries import parameter_entries
from impid_host.signals.arrays import Floats


def push_table(pushes: Pushes) -> Table:
    """Each stretch that is unlike the rest of its trial."""
    table = Table(
        title="Stretches unlike the rest of their trial: a push, a slip, or something that the model lacks",
        title_justify="left",
        caption=_what_follows(pushes),
        caption_justify="left",
    )
    for heading in ("trial", "from, s", "to, s", "residual's power\nagainst the usual", "took part in"):
        table.add_column(heading, justify="left" if heading in ("trial", "took part in") else "right")
    for push in pushes.found:
        part = "the fit" if push.fitted else "the held-out error alone"
        table.add_row(push.trial, f"{push.begin_s:.0f}", f"{push.end_s:.0f}", f"{push.ratio:.0f} times", part)
    return table


def _what_follows(pushes: Pushes) -> str:
    if pushes.reason:
        return f"Without them nothing could be fitted: {pushes.reason}"
    if pushes.loads or pushes.robot is not None:
        around = f"{MARGIN_S:.0f} s around each"
        return f"The numbers above include them. Below: the same fit without them and {around}."
    return "No number above moves with them; VAF and residual do."


def moved_tables(result: StudyFit, pushes: Pushes) -> Iterator[Table]:
    """Of the robot and every load that changes: each number as fitted and without the pushes."""
    if isinstance(result.robot, RobotFit) and pushes.robot is not None:
        before, after = result.robot.estimate, pushes.robot.estimate
        if before.names == after.names:
            table = _table("Robot", [""], caption=False)
            for k, name in enumerate(before.names):
                cells = _cells(before.value[k], before.ci95[k], after.value[k], after.ci95[k])
                table.add_row(name, *cells, before.units[k])
            yield table
    for load in dict.fromkeys(fit.load for fit in pushes.loads):
        pairs = [
            (fit, without)
            for fit in result.loads
            if fit.load == load and (without := pushes.without(fit)) is not None
        ]
        table = _table(f"Load {load}", [f"{METHODS[fit.method]}\n" for fit, _ in pairs])
        for entry in parameter_entries(pairs[0][0]):
            by_method = [_cells(*entry.of(fit), *entry.of(rest)) for fit, rest in pairs]
            table.add_row(entry.label, *chain.from_iterable(by_method), entry.unit)
        yield table


def _table(what: str, methods: Sequence[str], *, caption: bool = True) -> Table:
    table = Table(
        title=f"{what}: what these stretches moved (+- 95 %)",
        title_justify="left",
        caption="change: as fitted, less without them" if caption else None,
        caption_justify="left",
    )
    table.add_column("quantity", overflow="fold")
    for method in methods:
        for heading in ("as fitted", "without them", "change"):
            table.add_column(f"{method}{heading}", justify="right", overflow="fold")
    table.add_column("unit", overflow="fold")
    return table


def _cells(value: float, ci: Floats, rest: float, rest_ci: Floats) -> tuple[str, str, str]:
    change = number(value - rest, ci)
    return (
        plus_minus(value, ci),
        plus_minus(rest, rest_ci),
        change if change.startswith("-") else f"+{change}",
    )
