"""The commands of `stereogrid`, one file each. What takes seconds to import is imported inside the command."""
