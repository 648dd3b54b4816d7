"""Maps in the browser, by viser: the extra `view`."""

from .live import LiveView
from .page import MapPage
from .subject import Subject, is_run, subject_of_map, subject_of_recording, subject_of_run

__all__ = ["LiveView", "MapPage", "Subject", "is_run", "subject_of_map", "subject_of_recording", "subject_of_run"]
