"""Findings to one HTML file that holds everything it shows."""

import re
from collections.abc import Sequence
from importlib import resources

import jinja2
from markupsafe import Markup, escape

from impid_host.cli.checked import unconfirmed
from impid_host.diagnosis.result import UNATTRIBUTED
from impid_host.effects.catalogue import CATALOGUE
from impid_host.report.diagnosis_units import structure_words
from impid_host.report.page import tables
from impid_host.report.page.bode_plots import bode_plots
from impid_host.report.page.findings import Findings
from impid_host.report.page.in_short import in_short
from impid_host.report.page.load_plots import ellipse_plots, force_plots
from impid_host.report.page.plot import Plot, Span
from impid_host.report.page.provenance import provenance, sessions
from impid_host.report.page.quality import quality_table
from impid_host.report.page.residual_plots import (
    event_spans,
    fit_residual_plots,
    leftover_plots,
    push_spans,
    residual_plots,
    signature_plots,
)
from impid_host.report.page.section import Section
from impid_host.report.page.svg import svg, swatch
from impid_host.report.page.tables import PageTable


def write_page(everything: Sequence[Findings], command: Sequence[str], extra: Sequence[Section] = ()) -> str:
    """The page of one or several studies.

    Args:
        command: that made it, for its provenance.
        extra: sections about all studies together, above them.
    """
    environment = _environment()
    here = resources.files("impid_host.report.page")
    return environment.get_template("page.html.jinja").render(
        studies=[
            (own, sessions(own.study), _opening(own), in_short(own), sections(own, command))
            for own in everything
        ],
        extra=list(extra),
        css=Markup((here / "page.css").read_text(encoding="utf-8")),
        js=Markup((here / "page.js").read_text(encoding="utf-8")),
    )


def tables_html(parts: Sequence[PageTable]) -> str:
    """Tables alone, for a notebook."""
    template = _environment().get_template("table.html.jinja")
    return "".join(str(template.module.table(part)) for part in parts)  # type: ignore[attr-defined]


def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("impid_host.report", "page"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters |= {
        "coded": _coded,
        "svg": lambda plot: Markup(svg(plot)),
        "swatch": lambda line: Markup(swatch(line)),
    }
    return environment


def _coded(text: str) -> Markup:
    """Text in which `this` is code."""
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text))))


def figures(findings: Findings) -> list[Plot]:
    """Every plot of a study, in the page's order."""
    return [plot for section in sections(findings, ()) for plot in section.plots]


def _opening(findings: Findings) -> str:
    """The paragraph that a reader in a hurry reads."""
    words = findings.verdict[:1].upper() + findings.verdict[1:]
    assumption = unconfirmed(findings.study)
    return f"{words}." + (f" {assumption}" if assumption else "")


def sections(findings: Findings, command: Sequence[str]) -> list[Section]:
    """A study's parts that hold anything."""
    return [part for part in _all(findings, command) if part.tables or part.plots or part.words]


def _all(findings: Findings, command: Sequence[str]) -> list[Section]:
    fit, answer = findings.fit, findings.diagnosis
    notes = () if answer is None else answer.notes
    return [
        *_results(findings),
        _effects(findings),
        Section(
            "Residuals of whole trials",
            "What the model leaves. Good: a band as thin as the noise, the same everywhere. Slow waves, "
            "steps at turning points and stretches unlike the rest are things that the model lacks.",
            plots=tuple(
                residual_plots(answer)
                if answer is not None
                else fit_residual_plots(fit, findings.pushes)
                if fit
                else ()
            ),
            words=notes,
        ),
        Section(
            "Ellipses",
            "Long along the direction in which the hand is stiff, damped or heavy. Faint lines that fill a "
            "wide band say that the matrix is poorly known.",
            plots=tuple(ellipse_plots(fit, answer) if fit else ()),
        ),
        Section(
            "Force, estimated and measured",
            "The virtual sensor's force beside the physical sensor's, or, without one, the load model's.",
            plots=tuple(force_plots(fit, lambda trial: _events(findings, trial)) if fit else ()),
        ),
        Section(
            "Frequency response",
            "Where the coherence is low, the motion is not the force's doing, and the gain is a guess.",
            plots=tuple(plot for own in fit.spectral for plot in bode_plots(own)) if fit else (),
        ),
        Section("Data quality", "", (tables.of_terminal(quality_table(findings.study, fit)),)),
        Section("Provenance", "", (tables.provenance_table(provenance(findings, command)),), shut=True),
    ]


def _results(findings: Findings) -> list[Section]:
    """The last model first; without a diagnosis the fit is all there is."""
    letters = "M is inertia, B damping, K stiffness, x0 the place of rest; alpha are the robot's parameters."
    fitted, words = tuple(tables.fit_tables(findings)), tables.fit_words(findings)
    if findings.diagnosis is None:
        return [Section("Result", letters, fitted, words=words)]  # why no more stands in the opening
    about = "What a fit without the effects found would have reported, by each force sensor."
    return [
        Section("Result", letters, tuple(tables.diagnosis_tables(findings)), words=findings.missing),
        Section("By the first model", about, fitted, words=words),
    ]


def _events(findings: Findings, trial: str) -> list[Span]:
    """Stretches unlike the rest: the diagnosis' where there is one, else the fit's."""
    if findings.diagnosis is not None:
        return event_spans(findings.diagnosis.notes, trial)
    return push_spans(findings.pushes, trial)


def _effects(findings: Findings) -> Section:
    """What was found and its mark on the residual; what could not be told or named."""
    answer = findings.diagnosis
    if answer is None:
        return Section("Effects found", "")
    words = []
    for stage in answer.stages[1:]:
        if stage.added is not None and stage.added.effect in CATALOGUE:
            row = CATALOGUE[stage.added.effect]
            words.append(f"{stage.added.label}: {row.equation} ({row.source}); it acts on the {row.acts_on}.")
    words += [f"No known effect explains this: {structure_words(row, answer)}." for row in answer.structure]
    for tie in answer.ambiguous:
        unsure = (
            f"tell {' from '.join(tie.candidates)}"
            if len(tie.candidates) > 1
            else f"say whether {tie.candidates[0]} is there"
        )
        words.append(f"These data cannot {unsure}; {tie.tell_apart_by} would.")
    if not words and not any(s.added is not None and s.added.effect != UNATTRIBUTED for s in answer.stages):
        words.append("None.")
    return Section(
        "Effects found",
        "Each figure shows the mean residual over what it hung on most: before, and with everything found "
        "taken out. After should lie on zero.",
        tuple(tables.effects(findings)),
        (*signature_plots(answer), *leftover_plots(answer)),
        tuple(words),
    )
