"""The commands of `python -m hardware`, one a file: what they ask for and say; the work is done elsewhere."""
