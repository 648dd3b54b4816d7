"""Where the cameras of a bag sit, by its transforms."""

from dataclasses import dataclass

import numpy as np

from ..errors import InvalidInputError
from ..geometry import R_BASE_OPTICAL, FloatArray, from_rotation, inverse
from .transforms import Transforms, last_name

BASES = ("base_footprint", "base_link", "base")
"""Frames of the robot's body that are our `base`: the first is on the ground."""
_UP = 0.7
"""No camera of a rig that maps looks so far up: its z axis against that of its base."""


@dataclass(frozen=True)
class Placing:
    """T_base_cam (4, 4): of the rectified left camera; T_child_base (4, 4): of our base in the frame of which the
    odometry tells; notes: what had to be assumed."""

    T_base_cam: FloatArray
    T_child_base: FloatArray
    notes: tuple[str, ...] = ()


def placing(
    tree: Transforms, camera: str, child: str, *, T_base_cam: FloatArray | None, R_rect_lens: FloatArray
) -> Placing:
    """How camera, base and odometry belong together.

    camera: the frame of the left pictures; child: the frame of which the odometry tells, "" where it does not say;
    T_base_cam (4, 4): the mount of the rectified camera as the user gives it; R_rect_lens (3, 3): from the left lens's
    frame, of which transforms tell, to the rectified camera's. An odometry that does not say of what is taken to be of
    the base, and so is one of a frame of which no transforms tell, where the mount is given.
    Raises InvalidInputError when nothing tells where the camera sits.
    """
    T_child_frame = np.eye(4) if child == camera else tree.fixed(child, camera) if child else None
    base, T_lens_cam = _base(tree, camera), from_rotation(R_rect_lens.T)
    T_base_frame = None if base is None else tree.fixed(base, camera)
    if T_base_cam is not None:
        if T_child_frame is None or last_name(child) in BASES:
            return Placing(T_base_cam, np.eye(4))
        T_frame_lens, notes = _lens(camera, T_base_frame)
        return _at_camera(T_child_frame @ T_frame_lens @ T_lens_cam, T_base_cam, notes)
    T_base_frame = T_child_frame if T_base_frame is None else T_base_frame
    if T_base_frame is None or (child and T_child_frame is None):
        raise InvalidInputError(_unplaced(tree, camera, child))
    if base is None and (child == camera or "optical" in child):
        T_frame_lens, notes = _lens(camera, None)
        note = f"nothing tells where {camera} sits on a robot: the base is at the camera"
        T_base_cam = from_rotation(R_BASE_OPTICAL) @ T_lens_cam
        return _at_camera(T_base_frame @ T_frame_lens @ T_lens_cam, T_base_cam, (*notes, note))
    T_frame_lens, notes = _lens(camera, T_base_frame)
    T_child_base = np.eye(4) if T_child_frame is None else T_child_frame @ inverse(T_base_frame)
    note = f"camera: {camera}, as {base or child} carries it"
    return Placing(T_base_frame @ T_frame_lens @ T_lens_cam, T_child_base, (note, *notes))


def _at_camera(T_child_cam: FloatArray, T_base_cam: FloatArray, notes: tuple[str, ...]) -> Placing:
    """Of an odometry of what carries the camera, whose mount is known from elsewhere."""
    return Placing(T_base_cam, T_child_cam @ inverse(T_base_cam), notes)


def _base(tree: Transforms, camera: str) -> str | None:
    """The frame of the robot's body that carries the camera."""
    carried = tree.fixed_relatives(camera)
    return next((frame for name in BASES for frame in carried if last_name(frame) == name), None)


def _lens(camera: str, T_base_frame: FloatArray | None) -> tuple[FloatArray, tuple[str, ...]]:
    """T_frame_lens (4, 4): drivers that name a frame of x forward, z up in their pictures are not rare."""
    if "optical" in camera:
        return np.eye(4), ()
    body = camera.endswith("_link") if T_base_frame is None else T_base_frame[2, 2] > _UP
    if not body:
        return np.eye(4), ()
    note = f"{camera} is not an optical frame, as its pictures should name: x is taken to be forward and z up"
    return from_rotation(R_BASE_OPTICAL), (note,)


def _unplaced(tree: Transforms, camera: str, child: str) -> str:
    known = ", ".join(tree.fixed_relatives(camera)[1:]) or "nothing"
    of = child or " or ".join(BASES[:2])
    return (
        f"no fixed transforms lead from {of} to the left camera's frame {camera!r} (which {known} carries): say "
        "where it sits (--mount x,y,z[,pitch,yaw,roll] [m, degrees])"
    )
