"""A measurement campaign on disk and in memory: the study folder, its trials, importers of foreign logs."""
