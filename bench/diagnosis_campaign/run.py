"""One study, from a seed to a line of the campaign's file."""

import shutil
import tempfile
import time
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from impid_host.diagnosis import proof
from impid_host.diagnosis.base import base_of
from impid_host.diagnosis.diagnose import diagnose
from impid_host.diagnosis.holdout import hold_out
from impid_host.diagnosis.prepare import views
from impid_host.diagnosis.result import Diagnosis
from impid_host.errors import ImpidError
from impid_host.robot.model import robot_model
from impid_host.study.folder import read_study
from impid_host.study.model import Study

from diagnosis_campaign.accuracy import bias, parameters
from diagnosis_campaign.cases import Case
from diagnosis_campaign.verdict import judged
from hil_sim.effects.entry import Entry
from hil_sim.errors import SimError
from hil_sim.scenarios.random import SMALL, random_scenario
from hil_sim.scenarios.schema import Scenario
from hil_sim.study.write import write_study
from hil_sim.trials import effects_in

Json = dict[str, Any]


def run(case: Case) -> Json:
    """The line of one study. Whatever goes wrong on the way is a line too."""
    line: Json = asdict(case)
    folder = Path(tempfile.mkdtemp(prefix="impid-campaign-"))
    begin = time.process_time()
    try:
        scenario, reached = _laboratory(case, case.effects)
        line["reached"] = reached
        study = _simulated(scenario, folder / "study", case.seed)
        floor = _floor(case, folder / "clean", study)
        simulated = time.process_time()
        answer = diagnose(study)
        line |= judgement(case, scenario, answer, floor)
        line["seconds"] = {"simulate": simulated - begin, "diagnose": time.process_time() - simulated}
    except (SimError, ImpidError) as error:
        line |= {"verdict": "error", "error": str(error)}
    except Exception as error:
        line |= {"verdict": "error", "error": f"{type(error).__name__}: {error}"}
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return line


def judgement(case: Case, scenario: Scenario, answer: Diagnosis, floor: Mapping[str, float]) -> Json:
    """Verdict, errors and biases of an answer."""
    hidden = _hidden(scenario)
    first, last = answer.stages[0], answer.stages[-1]
    findings = [stage.added for stage in answer.stages if stage.added is not None]
    found = [f"{one.effect}@{'+'.join(one.where)}" for one in findings]
    ties = [list(tie.candidates) for tie in answer.ambiguous]
    verdict = judged(case.effects, found, ties, structure=bool(answer.structure))
    return {
        "truth": [
            {"effect": one.effect, "where": list(one.where), "trials": list(one.trials), **one.values}
            for one in hidden.values()
        ],
        "verdict": verdict.word,
        "first_right": verdict.first_right,
        "place_right": verdict.place_right,
        "tied": verdict.tied,
        "found": found,
        "ties": ties,
        "structure": [row.words for row in answer.structure],
        "notes": list(answer.notes),
        "over_floor": {
            "before": {name: value / floor[name] for name, value in first.rms.items()},
            "after": {name: value / floor[name] for name, value in last.rms.items()},
            "by_host": {name: value / answer.floor[name] for name, value in last.rms.items()},
        },
        "bias": {"before": bias(first, scenario), "after": bias(last, scenario)},
        "parameters": {
            one.effect: parameters(one, hidden[one.effect]) for one in findings if one.effect in hidden
        },
    }


def _hidden(scenario: Scenario) -> dict[str, Entry]:
    return {one.effect: one for trial in scenario.trials for one in effects_in(scenario, trial)}


def _laboratory(case: Case, effects: tuple[str, ...]) -> tuple[Scenario, dict[str, float]]:
    return random_scenario(
        case.seed,
        SMALL,
        effects,
        case.strength,
        noise=case.noise,
        force_sensor=case.force_sensor,
        counts_per_rev=case.counts_per_rev,
    )


def _simulated(scenario: Scenario, folder: Path, seed: int) -> Study:
    write_study(scenario, folder, seed)
    return read_study(folder)


def _floor(case: Case, folder: Path, study: Study) -> dict[str, float]:
    """What the same laboratory's papers' model leaves on held-out data, same noise, with nothing hidden."""
    if case.effects:
        clean, _ = _laboratory(case, ())
        study = _simulated(clean, folder, case.seed)
    model = robot_model(study.setup.robot)
    parts, _ = views(study, model)
    answer = proof.report(
        parts,
        [],
        base_of(parts, model),
        hold_out(parts),
        handle_mass_kg=study.setup.handle_mass_kg,
        prior=None,
    )
    return {name: float(np.maximum(value, 1e-12)) for name, value in answer[2].items()}
