"""A diagnosis as tables to read in a terminal."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from rich.table import Column, Table

from impid_host.diagnosis.result import UNATTRIBUTED, Diagnosis, Number, Reported, Rival, Stage
from impid_host.report.diagnosis_units import channel_unit

_AXES = ("x", "y")


def stage_name(stage: Stage) -> str:
    """What the stage adds."""
    if stage.added is None:
        return "first model"
    when = "" if stage.added.when == "all" else f" ({stage.added.when} trials)"
    return f"+ {stage.added.label}{when}"


def stage_table(diagnosis: Diagnosis) -> Table:
    """Error on held-out data, stage by stage."""
    keys = list(diagnosis.stages[0].rms)
    heads = [_numbers(f"{key} ({channel_unit(key, diagnosis.prismatic)})") for key in keys]
    title = f"{diagnosis.study}: rms and VAF on held-out data, below {diagnosis.cutoff_hz:g} Hz"
    table = Table(Column("model", no_wrap=True), *heads, title=title, title_justify="left")
    for number, stage in enumerate(diagnosis.stages):
        row = [f"{stage.rms[key]:.3g}\n{stage.vaf[key]:.2f} %" for key in keys]
        table.add_row(stage_name(stage), *row, end_section=number == len(diagnosis.stages) - 1)
    told = diagnosis.told
    level = diagnosis.floor
    floor = ["unknown" if level.get(k) is None else f"{level[k]:.3g}\n{told.origin(k)}" for k in keys]
    table.add_row("noise floor\nby", *floor)
    for words, values in (("repeated motion", told.repeated), ("data sheet and resolution", told.specified)):
        if values:
            table.add_row(words, *(f"{values[key]:.3g}" if key in values else "" for key in keys))
    return table


def _numbers(head: str) -> Column:
    """A column of numbers: to the right, so that they are marked where they are not to be trusted."""
    return Column(head, justify="right")


def effect_table(diagnosis: Diagnosis) -> Table:
    """What was found, with intervals, evidence and the runner-up."""
    heads = ("parameters", "explains", "predicts better by", "sure", "runner-up")
    table = Table("effect", *map(_numbers, heads), title_justify="left")
    for stage in diagnosis.stages[1:]:
        found = stage.added
        assert found is not None
        if found.effect == UNATTRIBUTED:
            table.add_row(found.label, "", f"{100 * found.evidence.share_of_residual:.0f} %", "", "", "")
            continue
        evidence = found.evidence
        words = "\n".join(f"{name} {number_words(number)}" for name, number in found.parameters.items())
        rival = evidence.runner_up
        second = "" if rival is None else _beside(rival)
        table.add_row(
            found.label,
            words,
            f"{100 * evidence.share_of_residual:.0f} %",
            f"{evidence.gain:.0f} ± {evidence.gain_se:.0f} nats",
            f"{evidence.confidence:.2f}",
            second,
        )
    return table


def _beside(rival: Rival) -> str:
    """A rival may predict a little better: of what is not clearly worse the simplest was chosen."""
    by = f"{abs(rival.margin):.0f} nats {'less' if rival.margin >= 0 else 'more'}"
    return f"{rival.effect}@{'+'.join(rival.where)}, {by}"


def parameter_table(diagnosis: Diagnosis) -> Table:
    """What would have been reported without the effects, and what is with them, entry by entry."""
    names = ["would have been reported" if s.added is None else stage_name(s) for s in diagnosis.stages]
    columns = [_numbers(head) for head in (*names, "change")]
    title = "robot and loads by the first model and with what was found (95 % intervals)"
    table = Table("", *columns, title=title, title_justify="left")
    rows = [{entry.label: entry for entry in entries_of(stage)} for stage in diagnosis.stages]
    group = ""
    for label in dict.fromkeys(label for row in rows for label in row):
        head = label.split()[0] if " " in label else "robot"
        if group and head != group:
            table.add_section()
        group = head
        own = [row.get(label) for row in rows]
        cells = ["" if entry is None else _words(entry) for entry in own]
        table.add_row(label, *cells, _change(own[0], own[-1]))
    return table


@dataclass(frozen=True, slots=True)
class StageEntry:
    """One number of a stage.

    Attributes:
        load: "" for the robot; letter: M, B, K, x0, or the robot parameter's name; axes: "xy", say.
        half: of the 95 % interval; parts: of it, by cause, where that was worked out.
    """

    load: str
    letter: str
    axes: str
    value: float
    half: float
    unit: str
    parts: Mapping[str, float] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """As a row of a table is headed."""
        return f"{self.load} {self.letter}{self.axes}".strip()


def entries_of(stage: Stage) -> Iterator[StageEntry]:
    """Each number of a stage that says something of its own."""
    halves = stage.alpha.half
    for name, value, half in zip(stage.alpha_names, stage.alpha.value, halves, strict=True):
        yield StageEntry("", name, "", float(value), float(half), "")
    for load, numbers in stage.loads.items():
        for letter, number in numbers.items():
            causes = stage.parts.get(load, {}).get(letter, {})
            places = _own_places(number)
            for index in places:
                yield StageEntry(
                    load,
                    letter,
                    "".join(_AXES[k] for k in index) if len(places) > 1 else "",
                    float(number.value[index]),
                    float(number.half[index]),
                    number.unit,
                    {cause: float(own[index]) for cause, own in causes.items()},
                )


def _own_places(number: Number) -> list[tuple[int, ...]]:
    """Indices without those that repeat another by symmetry, or are zero by the load's model."""
    value, known = number.value, np.ptp(number.ci95, axis=-1) == 0
    places = []
    for index in np.ndindex(value.shape):
        mirrored = len(index) == 2 and index[0] > index[1] and value[index] == value[index[::-1]]
        scalar = index == (1, 1) and bool(known[0, 1]) and value[1, 1] == value[0, 0]
        if not (mirrored or scalar or (bool(known[index]) and value[index] == 0)):
            places.append(index)
    return places


def _words(entry: StageEntry) -> str:
    """A value to the digit that its interval lets one believe."""
    value, half, unit = entry.value, entry.half, entry.unit
    if half > 0 and np.isfinite(half):
        digits = max(0, 1 - int(np.floor(np.log10(half))))
        text = f"{value:.{digits}f} ± {half:.{digits}f}" if digits < 8 else f"{value:.5g} ± {half:.2g}"
    else:
        text = f"{value:.4g}"
    return f"{text} {unit}".strip()


def _change(first: StageEntry | None, last: StageEntry | None) -> str:
    if first is None or last is None:
        return "" if last is None else "new"
    if first.value == last.value or abs(first.value) < 3 * first.half:
        return ""
    share = 100 * (last.value / first.value - 1)
    outside = abs(last.value - first.value) > first.half
    return f"{share:+.1f} %" + (", outside the interval" if outside else "")


def number_words(reported: Reported) -> str:
    """Value plus or minus half its interval, entry by entry; of each trial or load where each has its own."""
    if not isinstance(reported, Number):
        return "; ".join(f"{name} {number_words(own)}" for name, own in reported.items())
    values, halves = reported.value.ravel(), reported.half.ravel()
    unit = "" if reported.unit in ("SI", "1") else f" {reported.unit}"
    return ", ".join(f"{v:.4g} ± {h:.2g}" for v, h in zip(values, halves, strict=True)) + unit
