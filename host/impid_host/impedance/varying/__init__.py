"""Impedance that changes with time, with posture, or with whatever a column holds."""
