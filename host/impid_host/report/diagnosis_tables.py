"""A diagnosis as tables to read in a terminal."""

from rich.table import Column, Table

from impid_host.diagnosis.result import Diagnosis, Number


def stage_table(diagnosis: Diagnosis) -> Table:
    """Error on held-out data, stage by stage."""
    keys = list(diagnosis.stages[0].rms)
    title = f"{diagnosis.study}: rms (N m, N) and VAF on held-out data"
    table = Table(Column("model", no_wrap=True), *keys, title=title, title_justify="left")
    for number, stage in enumerate(diagnosis.stages):
        name = (
            "papers' model"
            if stage.added is None
            else f"+ {stage.added.effect}@{'+'.join(stage.added.where)}"
        )
        row = [f"{stage.rms[key]:.3g}\n{stage.vaf[key]:.2f} %" for key in keys]
        table.add_row(name, *row, end_section=number == len(diagnosis.stages) - 1)
    table.add_row("noise floor", *(f"{diagnosis.floor[key]:.3g}" for key in keys))
    return table


def effect_table(diagnosis: Diagnosis) -> Table:
    """What was found, with intervals, evidence and the runner-up."""
    table = Table("effect", "parameters", "explains", "p", "runner-up", title_justify="left")
    for stage in diagnosis.stages[1:]:
        found = stage.added
        assert found is not None
        words = ", ".join(f"{name} {number_words(number)}" for name, number in found.parameters.items())
        rival = found.runner_up
        second = (
            ""
            if rival is None
            else f"{rival.effect}@{'+'.join(rival.where)}, {100 * rival.margin:.0f} % less"
        )
        table.add_row(
            f"{found.effect}@{'+'.join(found.where)}",
            words,
            f"{100 * found.share_of_residual:.0f} %",
            f"{found.p_value:.1g}",
            second,
        )
    return table


def parameter_table(diagnosis: Diagnosis) -> Table:
    """What would have been reported without the effects, and what is with them."""
    first, last = diagnosis.stages[0], diagnosis.stages[-1]
    table = Table("", "papers' model", "with the effects found", title_justify="left")
    table.add_row("alpha", number_words(first.alpha), number_words(last.alpha), end_section=True)
    for name, load in first.loads.items():
        for letter, number in load.items():
            table.add_row(f"{name} {letter}", number_words(number), number_words(last.loads[name][letter]))
    return table


def number_words(number: Number) -> str:
    """Value plus or minus half its interval, entry by entry."""
    values = number.value.ravel()
    halves = 0.5 * (number.ci95[..., 1] - number.ci95[..., 0]).ravel()
    unit = "" if number.unit in ("SI", "1") else f" {number.unit}"
    return " ".join(f"{v:.4g}±{h:.1g}" for v, h in zip(values, halves, strict=True)) + unit
