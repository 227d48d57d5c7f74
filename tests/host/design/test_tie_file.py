"""A diagnosis read for its ties; what cannot be used is said with file and remedy."""

import json
from pathlib import Path

import pytest
from impid_host.design.tie_file import Named, read_ties
from impid_host.errors import InputError

GOOD = {
    "format": "impid-diagnosis/1",
    "study": "s",
    "cutoff_Hz": 4.5,
    "stages": [
        {"added": None},
        {"added": {"effect": "friction.coulomb", "where": "joint1", "when": "free"}},
        {"added": {"effect": "unattributed", "where": ["joint1"], "when": "all"}},
    ],
    "ambiguous": [{"candidates": ["a@x", "b@y"], "tell_apart_by": "words"}],
}


def test_ties_and_certain_names_are_read(tmp_path: Path) -> None:
    path = tmp_path / "d.json"
    path.write_text(json.dumps(GOOD))
    found = read_ties(path)
    assert found.ties == (("a@x", "b@y"),)
    assert found.named == (Named("friction.coulomb", ("joint1",), "free"),)
    assert (found.study, found.cutoff_hz) == ("s", 4.5)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "cannot be read"),
        ("{", "is no diagnosis"),
        ("[]", "has format None"),
        (json.dumps(GOOD | {"format": "impid-judge/1"}), "has format 'impid-judge/1'"),
        (json.dumps(GOOD | {"ambiguous": []}), "leaves nothing open"),
        (json.dumps(GOOD | {"ambiguous": [{"candidates": "a@x"}]}), "does not fit"),
    ],
)
def test_what_is_no_diagnosis_is_refused_by_name(tmp_path: Path, text: str | None, words: str) -> None:
    path = tmp_path / "d.json"
    if text is not None:
        path.write_text(text)
    with pytest.raises(InputError, match=words) as error:
        read_ties(path)
    assert str(path) in str(error.value)
