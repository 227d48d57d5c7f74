"""The report: one HTML page, and the same figures for a journal. `docs/report.md` explains how to read it."""
