"""Random numbers of the faults: a stream for each fault, observation and side, so that none shifts another."""

import numpy as np

LEFT, RIGHT = 0, 1

_FAULTS = (
    "exposure",
    "exposure of a picture",
    "white balance",
    "calibration",
    "shot noise",
    "read noise",
    "skew",
    "drop",
    "repeat",
)


def stream(seed: int, fault: str, *keys: int) -> np.random.Generator:
    """The stream of a fault under seed; keys: the observation's index and the side, as far as they matter.

    It depends on these alone: arms with other faults, other numbers or another order of reading share it.
    """
    return np.random.default_rng([seed, _FAULTS.index(fault), *keys])
