"""Colours that colour-blind readers tell apart too (Okabe and Ito's set), on white, grey and black."""

PATH_COLOUR = "#d55e00"
"""Where the camera is taken to have gone: vermilion."""
TRUTH_COLOUR = "#009e73"
"""What is true: bluish green."""
SCALE = "viridis"
"""For amounts: as bright as they are large, in print too."""
