"""Drives of the real robot as files."""

from .drive_recorder import DriveRecorder, about_drive
from .rate import Rate
from .recorder import RawRecorder, RecorderCounts

__all__ = ["DriveRecorder", "Rate", "RawRecorder", "RecorderCounts", "about_drive"]
