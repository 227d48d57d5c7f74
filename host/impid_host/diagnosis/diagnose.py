"""A diagnosis, from raw signals to an answer: prepare, choose, judge on sealed data, say what is left."""

from impid_host.diagnosis.answer import answer
from impid_host.diagnosis.case import Progress, prepare, silent
from impid_host.diagnosis.choice import chosen
from impid_host.diagnosis.result import Diagnosis
from impid_host.diagnosis.stages import Bench
from impid_host.diagnosis.upheld import upheld, with_honest_intervals, with_last_stage
from impid_host.study.model import Study


def diagnose(study: Study, progress: Progress = silent, *, cutoff_hz: float | None = None) -> Diagnosis:
    """Find what the first model lacks, add it, and judge it on data that took no part.

    Args:
        cutoff_hz: of the band in which errors are told; None: the one that `fit` takes, by the motion.

    Raises:
        UndeterminedError: the data do not determine the robot or a load, or there is nothing to diagnose.
    """
    choice = chosen(prepare(study, progress, cutoff_hz), progress)
    progress("judging on data that took no part", 0.85)
    setup = study.setup
    bench = Bench(choice.case, choice.table.noise.taps, setup.handle_mass_kg, setup.prior_alpha)
    judged = upheld(choice, bench)
    judged = with_last_stage(judged, bench)
    judged = with_honest_intervals(judged, bench, setup.tolerance)
    return answer(judged, bench, study)
