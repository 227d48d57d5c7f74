"""Checks: what contradicts itself or physics is said before any number is believed (docs/checks.md)."""

from impid_host.checks.agreement import Agreement, Pair, agreement
from impid_host.checks.check import Change, Check, Checks
from impid_host.checks.gate import Bounded, LoadNumbers, RobotNumbers, gate
from impid_host.checks.judge import check_study

__all__ = [
    "Agreement",
    "Bounded",
    "Change",
    "Check",
    "Checks",
    "LoadNumbers",
    "Pair",
    "RobotNumbers",
    "agreement",
    "check_study",
    "gate",
]
