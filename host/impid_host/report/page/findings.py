"""All that is known about a study, worked out once for the page: checks, fit, diagnosis, verdict."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from impid_host.checks import Agreement, Checks, agreement, check_study
from impid_host.checks.of_diagnosis import beside_diagnosis
from impid_host.checks.of_fit import gate_fit
from impid_host.checks.pushes import Pushes, find_pushes
from impid_host.diagnosis.diagnose import diagnose
from impid_host.diagnosis.result import Diagnosis
from impid_host.diagnosis.verdict import beside_checks
from impid_host.errors import UndeterminedError
from impid_host.impedance.campaign import Options, StudyFit, default_chain, fit_study
from impid_host.study.model import Study

Progress = Callable[[str], None]


def _silent(_words: str) -> None:
    return


@dataclass(frozen=True, slots=True)
class Findings:
    """A study with what was found out about it.

    Attributes:
        checks: of the input and of the last result there is; fit_checks: of the first model's fit alone.
        agreement: what was measured twice.
        pushes: stretches unlike the rest in what the first model leaves, and the fit without them.
        fit, diagnosis: None where the data do not determine them, or they were not asked for.
        verdict: the opening sentence, as `diagnose` says it.
        missing: why a part is not there, a sentence each.
    """

    study: Study
    checks: Checks
    fit_checks: Checks
    agreement: Agreement | None
    fit: StudyFit | None
    diagnosis: Diagnosis | None
    verdict: str
    missing: tuple[str, ...] = ()
    pushes: Pushes = field(default_factory=Pushes)

    @property
    def trusted(self) -> bool:
        """Nothing is impossible or contradicts itself, and there is a result at all."""
        return self.checks.trusted and self.fit is not None


def gather(
    study: Study, progress: Progress = _silent, *, diagnosed: bool = True, terms: tuple[str, ...] = ()
) -> Findings:
    """Check, fit and diagnose a study; what its data do not determine is left out with the reason.

    Args:
        diagnosed: look for what the first model lacks; takes a minute or so.
        terms: optional terms of the robot model in the fit, as `fit --with`.
    """
    progress(f"{study.name}: checking")
    checks = check_study(study)
    missing: list[str] = []
    first = None
    try:
        options = Options(chain=default_chain(study), terms=terms)
        first = fitted(study, options, checks, lambda words: progress(f"{study.name}: {words}"))
        checks = first.checks
    except UndeterminedError as error:
        missing.append(f"Nothing could be fitted: {error}")
    answer = None
    if diagnosed:
        try:
            answer = diagnose(study, lambda words, _share: progress(f"{study.name}: {words}"))
        except UndeterminedError as error:
            missing.append(f"No cause was looked for: {error}")
    else:
        missing.append("No cause was looked for: the report was asked for without `diagnose`")
    return _told(study, checks, first, answer, tuple(missing))


@dataclass(frozen=True, slots=True)
class FirstFit:
    """A fit and what is to be said of it.

    Attributes:
        agreement: what was measured twice; checks: with what physics and the second measurement say.
    """

    fit: StudyFit
    agreement: Agreement
    pushes: Pushes
    checks: Checks


def fitted(study: Study, options: Options, checks: Checks, progress: Progress = _silent) -> FirstFit:
    """Fit a study and look at the result.

    Args:
        checks: of the input, to be added to.

    Raises:
        UndeterminedError: as `fit_study`.
    """
    fit = fit_study(study, options, progress)
    twice = agreement(study, fit.loads)
    progress("looking for pushes")
    pushes = find_pushes(study, fit, options)
    return FirstFit(fit, twice, pushes, checks.with_more(gate_fit(fit)).with_more(twice.checks))


def _told(
    study: Study,
    checks: Checks,
    first: FirstFit | None,
    answer: Diagnosis | None,
    missing: tuple[str, ...],
) -> Findings:
    """The verdict beside the checks: the last result decides, as in `diagnose`."""
    fit = None if first is None else first.fit
    twice = None if first is None else first.agreement
    pushes = Pushes() if first is None else first.pushes
    if answer is None:
        words = beside_checks("; ".join(line[:1].lower() + line[1:] for line in missing), checks)
        return Findings(study, checks, checks, twice, fit, None, words, missing, pushes)
    last = beside_diagnosis(study, answer, checks)
    answer = replace(answer, verdict=beside_checks(answer.verdict, last))
    return Findings(study, last, checks, twice, fit, answer, answer.verdict, missing, pushes)
