"""What each score means, in words for a reader, whichever part of the scoring gives it."""

from .held_out import HELD_OUT_NAMES
from .names import BOUND_NAMES, PLAIN_NAMES, SCORE_NAMES

MEANINGS: dict[str, str] = {
    name: meaning for name, (_, meaning) in (SCORE_NAMES | BOUND_NAMES | HELD_OUT_NAMES | PLAIN_NAMES).items()
}
"""name -> meaning."""

OF_CELLS = (
    "V: the cells that the cameras could see within the range. OCCUPIED and FREE: what the true mesh makes of a cell; "
    "p: what the map says of it."
)
"""How to read MEANINGS, for those who see nothing else."""
