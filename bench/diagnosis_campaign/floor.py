"""What noise and the fitted robot leave where nothing is hidden: the first stage of a diagnosis without its search."""

from pathlib import Path

from impid_host.diagnosis.case import prepare, tabulated
from impid_host.diagnosis.stages import Bench
from impid_host.study.folder import read_study


def first_errors(folder: Path) -> dict[str, float]:
    """`validation_rms` of the first stage, as `impid-host diagnose` gives it."""
    study = read_study(folder)
    case = prepare(study)
    taps = tabulated(case).noise.taps
    bench = Bench(case, taps, study.setup.handle_mass_kg, study.setup.prior_alpha)
    return dict(bench.stage(bench.plain, None).rms)
