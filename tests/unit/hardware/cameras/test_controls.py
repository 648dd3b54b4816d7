"""What v4l2-ctl lists is understood under the names of old and new kernels; without it, a warning."""

import shutil

import pytest

from hardware.cameras.controls import (
    Control,
    chosen_controls,
    lock_controls,
    parse_controls,
    read_controls,
    set_controls,
)

PERIOD_S = 1 / 30
NEW = """
User Controls

                     brightness 0x00980900 (int)    : min=-64 max=64 step=1 default=0 value=-3
                       contrast 0x00980901 (int)    : min=0 max=64 step=1 default=32 value=32
        white_balance_automatic 0x0098090c (bool)   : default=1 value=1
                           gain 0x00980913 (int)    : min=0 max=100 step=1 default=0 value=7
           power_line_frequency 0x00980918 (menu)   : min=0 max=2 default=1 value=1 (50 Hz)
      white_balance_temperature 0x0098091a (int)    : min=2800 max=6500 step=1 default=4600 value=4600 flags=inactive

Camera Controls

                  auto_exposure 0x009a0901 (menu)   : min=0 max=3 default=3 value=3 (Aperture Priority Mode)
         exposure_time_absolute 0x009a0902 (int)    : min=1 max=5000 step=1 default=157 value=157 flags=inactive
     exposure_dynamic_framerate 0x009a0903 (bool)   : default=0 value=1
"""
OLD = """
                     brightness 0x00980900 (int)    : min=-64 max=64 step=1 default=0 value=-3
 white_balance_temperature_auto 0x0098090c (bool)   : default=1 value=1
      white_balance_temperature 0x0098091a (int)    : min=2800 max=6500 step=1 default=4600 value=4600 flags=inactive
                  exposure_auto 0x009a0901 (menu)   : min=0 max=3 default=3 value=3
              exposure_absolute 0x009a0902 (int)    : min=1 max=5000 step=1 default=157 value=157 flags=inactive
         exposure_auto_priority 0x009a0903 (bool)   : default=0 value=1
"""


def test_a_listing_is_read_line_by_line_and_its_headings_are_left_out() -> None:
    found = parse_controls(NEW)
    assert len(found) == 9
    assert found["brightness"] == Control("brightness", "int", -3, -64, 64)
    assert found["auto_exposure"] == Control("auto_exposure", "menu", 3, 0, 3)
    assert found["white_balance_automatic"] == Control("white_balance_automatic", "bool", 1)
    assert parse_controls("Failed to open /dev/video9: No such file or directory\n") == {}


@pytest.mark.parametrize(
    ("listing", "automatics", "exposure"),
    [
        (
            NEW,
            {"auto_exposure": 1, "exposure_dynamic_framerate": 0, "white_balance_automatic": 0},
            "exposure_time_absolute",
        ),
        (
            OLD,
            {"exposure_auto": 1, "exposure_auto_priority": 0, "white_balance_temperature_auto": 0},
            "exposure_absolute",
        ),
    ],
)
def test_automatics_go_off_first_and_the_values_stay_as_they_are(
    listing: str, automatics: dict[str, int], exposure: str
) -> None:
    chosen = chosen_controls(parse_controls(listing), PERIOD_S)
    assert list(chosen.items())[:3] == list(automatics.items())
    assert (chosen[exposure], chosen["white_balance_temperature"], chosen["brightness"]) == (157, 4600, -3)


@pytest.mark.parametrize(("asked_s", "set_to"), [(0.005, 50), (0.2, 333), (1e-6, 1)])
def test_an_exposure_that_is_asked_for_is_never_longer_than_a_picture_nor_beyond_the_range(
    asked_s: float, set_to: int
) -> None:
    assert chosen_controls(parse_controls(NEW), PERIOD_S, asked_s)["exposure_time_absolute"] == set_to


def test_a_camera_without_such_controls_has_nothing_set() -> None:
    assert chosen_controls({}, PERIOD_S) == {}


def test_without_v4l2_ctl_there_is_a_warning_with_the_remedy(monkeypatch: pytest.MonkeyPatch, tmp_path: object) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    chosen, said = lock_controls(("/dev/video0", "/dev/video2"), PERIOD_S)
    assert chosen == {} and "apt install v4l-utils" in said["warning"]
    assert "apt install v4l-utils" in set_controls("/dev/video0", {"gain": 1})["warning"]


@pytest.mark.skipif(shutil.which("v4l2-ctl") is None, reason="needs v4l2-ctl (apt install v4l-utils)")
def test_what_is_no_camera_has_no_controls_and_refuses_every_one() -> None:
    assert read_controls("/dev/null") == {}
    assert set(set_controls("/dev/null", {"gain": 1})["refused"]) == {"gain"}
    assert "warning" in lock_controls(("/dev/null", "/dev/null"), PERIOD_S)[1]
