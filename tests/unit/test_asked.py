"""What is said of a recording on the command line reaches it."""

from pathlib import Path

import drawn_bags as drawn
import numpy as np
import pytest

from stereogrid.calibration import Mount, StereoCalibration, save_calibration
from stereogrid.cli import app, run
from stereogrid.commands.asked import AskedRecording
from stereogrid.errors import InvalidInputError, RecordingError
from stereogrid.geometry import from_rotation
from stereogrid.recording import BagRecording, Selection

INFOS = ["--left-info-topic", "/l/info", "--right-info-topic", "/r/info"]


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One whose names nobody would find, and that does not say where its camera sits."""
    sent = [
        *drawn.infos(("/l/info", "/r/info")),
        *drawn.pictures(6, ("/front/port", "/front/starboard")),
        *drawn.odometry(7, "/wheels"),
    ]
    return drawn.write_bag1(tmp_path_factory.mktemp("bag") / "a.bag", sent)


def test_the_options_of_a_command_reach_the_recording(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    topics = ["--left-topic", "/front/port", "--right-topic", "/front/starboard", "--odometry-topic", "/wheels", *INFOS]
    assert run(app, ["info", str(bag), *topics]) == 1
    said = capsys.readouterr()
    assert "(--mount x,y,z[,pitch,yaw,roll] [m, degrees])" in said.err and said.err.count("\n") == 1
    assert "/wheels: nav_msgs/msg/Odometry, 7 messages\n" in said.out
    part = ["--mount", "0.1,0,0.4", "--start", "0.1", "--end", "0.45", "--stride", "2"]
    assert run(app, ["info", str(bag), *topics, *part]) == 0
    told = capsys.readouterr().out
    assert "2 of its 6 observations" in told and "poses: /wheels" in told
    assert run(app, ["info", str(bag), *topics, *part, "--poses", "standing"]) == 0
    assert "path 0.00 m" in capsys.readouterr().out


def test_a_calibration_brings_its_mount_which_a_mount_overrules(bag: Path, tmp_path: Path) -> None:
    calibration = StereoCalibration(
        (drawn.CAMERA.K,) * 2, (np.zeros(5),) * 2, from_rotation(np.eye(3), [-0.06, 0, 0]), (32, 24)
    )
    rig = tmp_path / "rig.toml"
    save_calibration(calibration, rig, T_base_cam=Mount(0.2, 0.0, 0.5).T_base_cam)
    asked = AskedRecording(bag, left_topic="/front/port", right_topic="/front/starboard", calibration=rig)
    opened = asked.open()
    assert isinstance(opened, BagRecording) and opened.T_base_cam[2, 3] == 0.5
    overruled = AskedRecording(**{**vars(asked), "mount": "0.2,0,0.7", "stride": 3}).open()
    assert isinstance(overruled, Selection) and overruled.T_base_cam[2, 3] == 0.7


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ({"poses": "gps"}, "no --poses named 'gps'; choose from: odometry, standing, truth"),
        ({"mount": "1,2"}, "--mount must be x,y,z"),
        ({"mount": "0,0,-1"}, "z_m, the lens above the ground"),
        ({"stride": 0}, "--stride must be >= 1, not 0"),
        ({"start": -1.0}, "--start must be >= 0 and finite, not -1.0"),
        ({"end": float("nan")}, "--end must be >= 0 and finite, not nan"),
        ({"start": 3.0, "end": 2.0}, "--end must not be before --start, as 2 s is before 3 s"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, said: dict[str, object], message: str) -> None:
    path = drawn.write_bag1(tmp_path / "a.bag", drawn.drive(2))
    with pytest.raises(InvalidInputError, match=message):
        AskedRecording(path, **said).open()  # type: ignore[arg-type]


def test_the_truth_is_claimed_where_it_is_asked_for(tmp_path: Path) -> None:
    path = drawn.write_bag1(tmp_path / "a.bag", drawn.drive(2))
    asked = AskedRecording(path)
    opened = asked.open()
    assert asked.claiming(opened) is opened
    with pytest.raises(RecordingError, match="carries no true pose"):
        AskedRecording(path, poses="truth").claiming(opened)
