"""Studies side by side: one long table, changes of M, B and K, what repeats say (docs/sessions.md)."""
