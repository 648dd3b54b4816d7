"""The one error of this package."""


class ArcosError(ValueError):
    """Bytes or values that the protocol does not know; the message names the culprit."""
