"""A row of the long table."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Row:
    """One number of one study.

    Attributes:
        subject, side, date, posture: of the trials behind it, "" where they were not said or differ;
            date as YYYY-MM-DD.
        load: "" for the robot's parameters.
        method: "method1" (virtual sensor), "method2" (physical sensor), "free trials", or "diagnose", the
            last model of a diagnosis.
        quantity: "kxx", say.
        value, low, high: with its 95 % interval; sd: standard deviation by noise within the study alone,
            without tolerances of the apparatus, which are the same in each session.
        trusted: nothing about the study is impossible or contradicts itself.
    """

    study: str
    subject: str
    side: str
    date: str
    posture: str
    load: str
    method: str
    quantity: str
    value: float
    low: float
    high: float
    sd: float
    unit: str
    trusted: bool
