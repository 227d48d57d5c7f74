"""A measurement campaign on disk and in memory: the study folder, its trials, and importers of foreign logs."""
