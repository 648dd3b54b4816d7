"""The truth of a recording, read and prepared when somebody asks for it."""

import threading
from typing import TYPE_CHECKING

import numpy as np

from ..errors import StereogridError
from ..geometry import Array, FloatArray
from .beside_truth import BesideTruth

if TYPE_CHECKING:
    import trimesh

    from ..recording import FileRecording


class Judging:
    """Prepares error colours on a thread of its own. progress: share done; fault: why there are none, in words."""

    def __init__(self, recording: "FileRecording | None") -> None:
        self._recording = recording
        self._mesh: trimesh.Trimesh | None = None
        self._found: tuple[tuple[float, float], BesideTruth] | None = None
        self._tried: tuple[float, float] | None = None
        self._thread: threading.Thread | None = None
        self.progress, self.fault = 0.0, ""

    def mesh(self) -> "trimesh.Trimesh | None":
        """The true mesh; None without one. Raises RecordingError when it cannot be read."""
        from ..scoring.truth import load_ply

        if self._mesh is None and self._recording is not None:
            ply = self._recording.truth_mesh_ply()
            self._mesh = None if ply is None else load_ply(ply)
        return self._mesh

    def beside(self, cell_m: float, range_m: float) -> BesideTruth | None:
        """The truth for cells of cell_m seen within range_m [m]; None while it is being prepared, and at a fault."""
        wanted = cell_m, range_m
        # In this order: a thread that has ended has left what it found.
        is_at_work = self._thread is not None and self._thread.is_alive()
        if self._found is not None and self._found[0] == wanted:
            return self._found[1]
        if not is_at_work and not (self.fault and self._tried == wanted):
            self._tried, self.fault, self.progress = wanted, "", 0.0
            self._thread = threading.Thread(target=self._prepare, args=wanted, name="truth", daemon=True)
            self._thread.start()
        return None

    def _prepare(self, cell_m: float, range_m: float) -> None:
        from ..scoring.truth import MapTruth

        def show(done: int, total: int) -> None:
            self.progress = done / total

        try:
            truth = MapTruth.of_recording(self._recording, cell_m, max_range_m=range_m, around_path=True, progress=show)
            self._found = (cell_m, range_m), BesideTruth(truth)
        except Exception as error:  # whatever a foreign truth leads to: else it would be tried again at every look
            self.fault = str(error) if isinstance(error, StereogridError) else repr(error)


def below(mesh: "trimesh.Trimesh", highest_m: float) -> tuple[FloatArray, Array]:
    """Corners (V, 3) [m] and those faces (F, 3) of a mesh that do not lie wholly above a height: no ceiling."""
    corners, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    return corners, faces[corners[faces, 2].min(axis=1) < highest_m]
