"""What the experiments on drives ask of a recording."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="the experiments drive through simulated worlds")

from faults_scenes import FewObservations

from experiments import drive_experiment, fusion, matchers
from experiments.drives import open_drive
from stereogrid.errors import RecordingError
from stereogrid.recording import McapWriter


def drawn_by(metadata: dict[str, str], path: Path) -> Path:
    drive = FewObservations(1)
    with McapWriter(path, drive.camera, drive.T_base_cam, metadata=metadata) as writer:
        for each in drive:
            writer.write(each)
    return path


def test_a_drive_drawn_for_a_quick_look_is_never_scored(tmp_path: Path) -> None:
    path = drawn_by({"renderer": "bullet"}, tmp_path / "quick.mcap")
    with pytest.raises(RecordingError, match=r"quick\.mcap: drawn by the renderer 'bullet', which is never for scores"):
        open_drive(path)


@pytest.mark.parametrize("metadata", [{"renderer": "raster"}, {}])
def test_a_drive_of_the_usual_renderer_or_of_none_that_is_known_is_opened(
    metadata: dict[str, str], tmp_path: Path
) -> None:
    drive = open_drive(drawn_by(metadata, tmp_path / "drive.mcap"))
    assert len(drive) == 1 and np.array_equal(drive.T_base_cam, np.eye(4))


@pytest.mark.parametrize("run", ["corridor", "matchers", "fusion"])
def test_the_experiments_refuse_it_before_they_begin(run: str, tmp_path: Path) -> None:
    path, runs = drawn_by({"renderer": "bullet"}, tmp_path / "quick.mcap"), tmp_path / "runs"

    def no_stage(name: str, total: float):  # type: ignore[no-untyped-def]
        raise AssertionError(f"{name} began")

    with pytest.raises(RecordingError, match="never for scores"):
        if run == "corridor":
            config = drive_experiment.DriveExperimentConfig()
            drive_experiment.run_story(None, config, no_stage, runs=runs, recording=path)  # type: ignore[arg-type]
        elif run == "matchers":
            matchers.run(matchers.MatchersConfig(), no_stage, runs=runs, recording=path)
        else:
            fusion.run(fusion.FusionConfig(), no_stage, runs=runs, recording=path)
    assert not runs.exists()
