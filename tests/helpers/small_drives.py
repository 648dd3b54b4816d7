"""Simulated drives seen by small pictures, for experiments that must run in seconds."""

from pathlib import Path

from sim.record import record_drive
from sim.rig import StereoRig
from stereogrid.camera import StereoCamera

SMALL = StereoCamera(focal_px=200, cx_px=95.5, cy_px=71.5, baseline_m=0.12, width_px=192, height_px=144)


def small_drive(path: Path, world: str = "corridor") -> Path:
    """Three pairs in half a metre."""
    return record_drive(path, world=world, rig=StereoRig(SMALL), every_m=0.25, max_distance_m=0.5)
