"""Checks: what contradicts itself or physics is said before any number is believed (docs/checks.md)."""

from impid_host.checks.check import Change, Check, Checks
from impid_host.checks.judge import check_study

__all__ = ["Change", "Check", "Checks", "check_study"]
