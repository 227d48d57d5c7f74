"""Names by which several studies are told apart."""

from collections import Counter
from collections.abc import Mapping
from pathlib import PurePath


def distinct_names(studies: Mapping[str, str]) -> dict[str, str]:
    """A name for each study by its place, with as many of its parents' names before it as tell it apart.

    >>> distinct_names({"/a/P07/day1": "day1", "/a/P08/day1": "day1", "/a/P08/day2": "day2"})
    {'/a/P07/day1': 'P07/day1', '/a/P08/day1': 'P08/day1', '/a/P08/day2': 'day2'}

    Args:
        studies: place (a path or an address) -> the study's own name.
    """
    names = dict(studies)
    parents = {place: list(PurePath(place).parent.parts) for place in studies}
    while True:
        counts = Counter(names.values())
        alike = [place for place, name in names.items() if counts[name] > 1 and parents[place]]
        if not alike:
            return names
        for place in alike:
            names[place] = f"{parents[place].pop()}/{names[place]}"
