"""PyBullet, imported without the line that it prints to stderr: errors of a command are one line there."""

import os

_stderr = os.dup(2)
with open(os.devnull, "w") as _nowhere:  # noqa: PTH123 - a descriptor is needed, not a path
    os.dup2(_nowhere.fileno(), 2)
    try:
        import pybullet
    finally:
        os.dup2(_stderr, 2)
        os.close(_stderr)

__all__ = ["pybullet"]
