"""The bench test of a board that has never run before: what it measures, and the report that it prints."""
