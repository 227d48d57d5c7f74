"""The live view of a recording: a page served by a process of its own."""
