"""What every report obeys."""

import re


def stands_alone(report: str) -> bool:
    """Whether a report loads nothing: pictures are inside, and links lead into its own folder."""
    return not re.search(r'src="(?!data:)|href="(?!\./)', report)
