"""One study, from a seed to a line of the campaign's file."""

import os
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from diagnosis_campaign.accuracy import bias, parameters
from diagnosis_campaign.answer import NoAnswerError, acts_in, ask, findings, label
from diagnosis_campaign.cases import Case
from diagnosis_campaign.floor import first_errors
from diagnosis_campaign.verdict import judged
from hil_sim.effects import catalogue
from hil_sim.effects.entry import Entry
from hil_sim.errors import SimError
from hil_sim.scenarios.random import SMALL, random_scenario
from hil_sim.scenarios.schema import Scenario
from hil_sim.study.write import write_study
from hil_sim.trials import effects_in, without_effects

Json = dict[str, Any]


def run(case: Case) -> Json:
    """The line of one study. Whatever goes wrong on the way is a line too."""
    line: Json = asdict(case)
    folder = Path(tempfile.mkdtemp(prefix="impid-campaign-"))
    try:
        begin = _cpu_s()
        scenario, reached = _laboratory(case, case.effects)
        line["reached"] = reached
        write_study(scenario, folder / "study", case.seed)
        _state_that_lengths_are_exact(folder / "study" / "setup.toml")
        simulated = _cpu_s()
        answer = ask(folder / "study")
        line["seconds"] = {"simulate": simulated - begin, "diagnose": _cpu_s() - simulated}
        line |= judgement(scenario, answer, _floor(case, folder, answer))
    except (SimError, NoAnswerError) as error:
        line |= {"verdict": "error", "error": str(error)}
    except Exception as error:
        line |= {"verdict": "error", "error": f"{type(error).__name__}: {error}"}
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return line


def _state_that_lengths_are_exact(setup: Path) -> None:
    """These robots are as long as declared, to the tenth of a micrometre: an interval that allowed for more would hold the truth always."""
    with setup.open("a", encoding="utf-8") as file:
        file.write("\n[tolerance]\nlink_lengths_m = 1e-7\n")


def judgement(scenario: Scenario, answer: Json, floor: Mapping[str, float]) -> Json:
    """Verdict, errors and biases of an answer."""
    hidden = _hidden(scenario)
    laboratory = without_effects(scenario, scenario.trials[0], 0)
    first, last = answer["stages"][0], answer["stages"][-1]
    added = findings(answer)
    found = [label(one) for one in added]
    truth = [f"{one.effect}@{'+'.join(one.where)}" for one in hidden.values()]
    ties = [list(tie["candidates"]) for tie in answer.get("ambiguous", [])]
    structure = [row["words"] for row in answer["unexplained"]["structure"]]
    verdict = judged(truth, found, ties, structure=bool(structure))
    by_host = {name: value for name, value in answer.get("noise_floor", {}).items() if value}
    return {
        "truth": [
            {
                "effect": one.effect,
                "where": list(one.where),
                "when": list(one.trials) or one.when,
                "per_trial": one.per_trial,
                **one.values,
            }
            for one in hidden.values()
        ],
        "hidden": truth,
        "verdict": verdict.word,
        "first_right": verdict.first_right,
        "place_right": verdict.place_right,
        "when_right": _when_right(scenario, hidden, added),
        "tied": verdict.tied,
        "found": found,
        "when": [one.get("when", "all") for one in added],
        "confidence": [one["evidence"].get("confidence") for one in added],
        "ties": ties,
        "structure": structure,
        "sentence": answer.get("verdict", ""),
        "notes": list(answer.get("notes", [])),
        "over_floor": {
            "before": {name: value / floor[name] for name, value in first["validation_rms"].items()},
            "after": {name: value / floor[name] for name, value in last["validation_rms"].items()},
            "by_host": {
                name: value / by_host[name]
                for name, value in last["validation_rms"].items()
                if name in by_host
            },
            "floor_by_host": {name: value / floor[name] for name, value in by_host.items() if name in floor},
        },
        "bias": {"before": bias(first, scenario), "after": bias(last, scenario)},
        "parameters": {
            one["effect"]: parameters(one, hidden[one["effect"]], laboratory)
            for one in added
            if one["effect"] in hidden
        },
    }


def _hidden(scenario: Scenario) -> dict[str, Entry]:
    return {one.effect: one for trial in scenario.trials for one in effects_in(scenario, trial)}


def _when_right(scenario: Scenario, hidden: Mapping[str, Entry], added: list[Json]) -> bool | None:
    """Whether every hidden effect that was named is said to act in the trials that have it; None: none was."""
    loads = {trial.name: trial.load for trial in scenario.trials}
    answers = []
    for one in added:
        entry = hidden.get(one["effect"])
        if entry is None:
            continue
        has = {
            name
            for name, load in loads.items()
            if catalogue.applies(entry, name, loaded=load is not None, load=load)
        }
        row = catalogue.ROWS[entry.effect]
        possible = {name for name, load in loads.items() if load is not None or not row.loaded_only}
        answers.append(acts_in(one, loads) & possible == has)
    return all(answers) if answers else None


def _laboratory(case: Case, effects: tuple[str, ...]) -> tuple[Scenario, dict[str, float]]:
    return random_scenario(
        case.seed,
        SMALL,
        effects,
        case.strength,
        noise=case.noise,
        force_sensor=case.force_sensor,
        counts_per_rev=case.counts_per_rev,
        weighed=case.weighed,
        torque_quantum_Nm=case.torque_step_Nm,
    )


def _floor(case: Case, folder: Path, answer: Json) -> dict[str, float]:
    """What the model without additions leaves on held-out data of the same laboratory with nothing hidden."""
    if case.effects:
        clean, _ = _laboratory(case, ())
        write_study(clean, folder / "clean", case.seed)
        rms = first_errors(folder / "clean")
    else:
        rms = answer["stages"][0]["validation_rms"]
    return {name: max(value, 1e-12) for name, value in rms.items()}


def _cpu_s() -> float:
    """Processor time of this process and those that it ran."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system
