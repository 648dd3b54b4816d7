"""`stereogrid`, and `python -m stereogrid`: Ctrl-C ends it quietly from here on, long before run() is there."""

from .early import end_at_once


def main() -> None:
    """The console script."""
    end_at_once()
    import sys

    from .cli import app, run

    sys.exit(run(app))


if __name__ == "__main__":
    main()
