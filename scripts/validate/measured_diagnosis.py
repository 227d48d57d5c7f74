"""Diagnoses of measured records: error before, after, of the textbook and as published; and on whole other records.

    python scripts/validate/measured_diagnosis.py [--data ../shared/data] [--out docs/validation] [--only KEY ...]

Writes measured.md and measured.json anew (with --only, the named records; the others stay as they were). Of every
record the last third (or, of three trials and more, the last) takes no part in choosing or fitting; a model that is to
serve another record of the machine is saved, read back and judged there, whole. `measured_records.py` has the records.
"""

import argparse
import json
import tempfile
import time
from dataclasses import asdict
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
from impid_host.diagnosis.case import prepare
from impid_host.diagnosis.diagnose import diagnose
from impid_host.diagnosis.holdout import SEALED
from impid_host.diagnosis.other_records import judge
from impid_host.diagnosis.proof import aligned, chain_of
from impid_host.diagnosis.saved import read_model, save_model
from impid_host.errors import ImpidError
from impid_host.impedance.rows import finish
from impid_host.report.diagnosis_json import diagnosis_json
from impid_host.study.model import Study
from measured_diagnosis_page import page
from measured_records import BY_KEY, RECORDS, Record, data_folder

Json = dict[str, Any]


def logged_rms(study: Study) -> dict[str, float]:
    """Rms of the logged torques in the band that is reported, on the held-out rows."""
    case = prepare(study)
    rows = []
    for view in case.views:
        trial = aligned(view)
        low = finish(chain_of(view), trial.tau, trial.rate_hz)
        rows.append(low[case.holdout.mask(view, SEALED) & trial.valid])
    mean = np.sqrt(np.mean(np.concatenate(rows) ** 2, axis=0))
    return {f"tau{k + 1}": float(value) for k, value in enumerate(mean)}


def entry_of(record: Record, study: Study, models: Path) -> Json:
    """A record's diagnosis, without its curves, and the textbook's error beside it; the model goes to `models`."""
    started = time.monotonic()
    head = {"machine": record.machine, "published": record.published}
    try:
        answer = diagnose(study)
    except ImpidError as error:
        return head | {"refused": str(error)}
    save_model(answer, study, models / f"{record.key}.json")
    document = diagnosis_json(answer)
    for row in document["unexplained"]["structure"]:
        del row["curve"], row["band"]
    for tie in document["ambiguous"]:
        del tie["parameters"]
    book = answer.textbook
    return head | {
        "diagnosis": document,
        "textbook": None if book is None else {"validation_rms": dict(book.rms), "vaf": dict(book.vaf)},
        "logged_rms": logged_rms(study),
        "seconds": round(time.monotonic() - started),
    }


def judged(model: Path, study: Study, *, refit_record: bool) -> Json:
    """A saved model's errors on another record."""
    answer = judge(read_model(model), [study], refit_record=refit_record)
    return {
        "left_out": list(answer.left_out),
        "refitted": list(answer.refitted),
        "bands": [asdict(band) for band in answer.bands],
    }


def crossings(data: Path, models: Path) -> dict[str, Json]:
    """Every model on every other record of its machine, with what is the record's own left out and fitted anew."""
    result: dict[str, Json] = {}
    for one, other in permutations(BY_KEY, 2):
        if BY_KEY[one].machine != BY_KEY[other].machine or not (models / f"{one}.json").is_file():
            continue
        study = BY_KEY[other].study(data)
        try:
            result[f"{one} -> {other}"] = {
                "plain": judged(models / f"{one}.json", study, refit_record=False),
                "refitted": judged(models / f"{one}.json", study, refit_record=True),
            }
        except ImpidError as error:
            result[f"{one} -> {other}"] = {"refused": str(error)}
    return result


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path)
    parser.add_argument("--out", type=Path, default=Path("docs/validation"))
    parser.add_argument("--models", type=Path, help="Keep the saved models in this folder.")
    parser.add_argument("--only", nargs="*", help="Diagnose these records alone.")
    options = parser.parse_args()
    unknown = set(options.only or ()) - set(BY_KEY)
    if unknown:
        parser.error(f"no record {', '.join(sorted(unknown))}; there are {', '.join(BY_KEY)}")
    data = data_folder(options.data)
    store = options.out / "measured.json"
    result: Json = {"records": {}, "judged": {}}
    if options.only is not None and store.is_file():
        result = json.loads(store.read_text(encoding="utf-8"))
    wanted = [record.key for record in RECORDS] if options.only is None else options.only
    with tempfile.TemporaryDirectory() as scratch:
        models = options.models or Path(scratch)
        models.mkdir(parents=True, exist_ok=True)
        for key in wanted:
            result["records"][key] = entry_of(BY_KEY[key], BY_KEY[key].study(data), models)
            write(result, options.out)
        result["judged"] |= crossings(data, models)
    write(result, options.out)


def write(result: Json, out: Path) -> None:
    """Both files, after every record: a stopped run loses nothing."""
    (out / "measured.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    (out / "measured.md").write_text(page(result, list(BY_KEY)), encoding="utf-8")


if __name__ == "__main__":
    main()
