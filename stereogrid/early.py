"""What a program does first: it imports next to nothing."""

import signal


def end_at_once() -> None:
    """From now on an interrupt (SIGINT) ends the process without a word, unless it is ignored, as of a background job.

    Ctrl-C during a program's imports would else show where they were; stereogrid.cli.run has it raised again.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
