"""What is said of a study: the stages beside the noise floor, what is left, notes, and one sentence."""

from collections.abc import Mapping, Sequence

from impid_host.diagnosis.allowance import widened
from impid_host.diagnosis.base import baseline
from impid_host.diagnosis.case import saturated
from impid_host.diagnosis.choice import Choice
from impid_host.diagnosis.floor import PER_COLUMN, noise_floor, resolution_of
from impid_host.diagnosis.judge import events_in_sealed
from impid_host.diagnosis.leftover import odd_structures
from impid_host.diagnosis.refit import Refit
from impid_host.diagnosis.result import Diagnosis, Floor, Stage, Structure
from impid_host.diagnosis.stages import Bench
from impid_host.diagnosis.tolerance import in_words
from impid_host.diagnosis.traces import traces
from impid_host.diagnosis.upheld import Judged
from impid_host.diagnosis.verdict import sentence
from impid_host.robot.model import RobotModel
from impid_host.study.model import Study

_ABOVE = 1.5  # of the noise floor: what is left is more than chance and an inexact model leave


def answer(judged: Judged, bench: Bench, study: Study) -> Diagnosis:
    """Everything that is reported; where more than noise is left, the intervals say so."""
    choice, case, left, ties = judged.choice, bench.case, judged.left, judged.verdict.ties
    stages = judged.stages
    told = floor_of(choice, judged.last, left, study)
    floor = {key: told.value(key) for key in stages[-1].rms}
    above = above_floor(stages[-1], floor, left)
    if above and left:
        stages = (*stages[:-1], widened(stages[-1], floor))
    units = {key: _unit(key, case.base.model) for key in floor}
    return Diagnosis(
        study=study.name,
        baseline=baseline(
            study.setup, case.base.model, given=all(view.load is not None for view in case.views)
        ),
        fit_trials=case.holdout.fit,
        validation_trials=case.holdout.validation,
        stages=stages,
        floor=floor,
        told=told,
        traces=traces(bench, bench.plain, judged.last),
        prismatic=all(case.base.model.prismatic),
        textbook=bench.textbook(stages[0]),
        ranges=case.setting.ranges,
        cutoff_hz=case.views[0].report_hz,
        share_unexplained=share_unexplained(stages[0].rms, stages[-1].rms, floor),
        above_noise_floor=above,
        structure=(*left, *odd_structures(case.oddities)),
        ambiguous=ties,
        verdict=sentence(stages, floor, ties, left, above, units=units, widened=bool(above and left)),
        notes=(*notes_of(choice, judged.last, stages[-1], study), *in_words(stages[-1])),
    )


def _unit(channel: str, model: RobotModel) -> str:
    """N of forces and of joints that slide."""
    slides = channel.startswith("tau") and model.prismatic[int(channel[3:].partition("_")[0]) - 1]
    return "N" if slides or not channel.startswith("tau") else "N*m"


def floor_of(choice: Choice, fit: Refit, left: Sequence[Structure], study: Study) -> Floor:
    """What noise alone leaves in each held-out channel; the lines of what hums are no noise."""
    case = choice.case
    lines_Hz = [row.peak for row in left if row.variable == "frequency" and len(row.curve)]
    seconds = sum(float(view.valid.sum()) * view.dt for view in case.views)
    independent = 2 * case.views[0].report_hz * seconds
    rich = saturated(case.base, choice.table.slots, round(5 * independent / PER_COLUMN))
    used = {view.name for view in case.views}
    logs = [(trial.robot.tau, trial.robot.force) for trial in study.trials if trial.name in used]
    return noise_floor(case, fit, rich, lines_Hz, resolution_of(logs))


def above_floor(last: Stage, floor: Mapping[str, float | None], left: Sequence[Structure]) -> bool | None:
    """Whether more than noise is left; None where nothing tells the noise."""
    if left or any(vaf < 0 for vaf in last.vaf.values()):
        return True
    known = {key: value for key, value in floor.items() if value is not None}
    return any(last.rms[key] > _ABOVE * value for key, value in known.items()) if known else None


def share_unexplained(
    first: Mapping[str, float], last: Mapping[str, float], floor: Mapping[str, float | None]
) -> float:
    """What is above the floor with all names, as a share of the first residual, in units of the floor."""
    level = {key: floor.get(key) or value for key, value in last.items()}
    before = sum((first[key] / level[key]) ** 2 for key in first if level.get(key))
    after = sum(max((last[key] / level[key]) ** 2 - 1, 0.0) for key in first if level.get(key))
    return float(after / max(before, 1e-300))


def notes_of(choice: Choice, fit: Refit, last: Stage, study: Study) -> list[str]:
    """What a reader must know of the data that were used."""
    case = choice.case
    words = [f"{event.words}: left out of the fit" for event in choice.pushed]
    sealed = events_in_sealed(case, fit, choice.table.noise.taps)
    words += [f"{event.words}: it is in the error on data that took no part" for event in sealed]
    words += unlike_its_model(last)
    if all(view.measured is None for view in case.views):
        words.append("no accelerometer: accelerations come from the angles, and its faults cannot be seen")
    unused = [trial.name for trial in study.of_kind("stochastic")]
    if unused:
        words.append(f"not used: {', '.join(unused)}; no effect is looked for in stochastic trials")
    return words


def unlike_its_model(last: Stage) -> list[str]:
    """Forces of a load that its model predicts worse than a constant would: no M, B, K describe it."""
    bad = [
        key for key, vaf in last.vaf.items() if vaf < 0 and key.startswith("f") and not key.startswith("fs")
    ]
    names = " and ".join(last.loads)
    return [
        f"{key}: the model of {names} predicts the held-out force worse than a constant does, so M, B and K "
        "describe what the robot holds in the fitted part at best"
        for key in bad
    ]
