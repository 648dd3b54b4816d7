"""Exposure and white balance that stand still, the same in both cameras: v4l2-ctl, where it is installed."""

import re
import shutil
import subprocess
from dataclasses import dataclass
from typing import Any

PATIENCE_S = 5.0
ABSENT = "v4l2-ctl is not installed (apt install v4l-utils): exposure and white balance stay as they are"
_LINE = re.compile(r"^\s*(?P<name>\w+) 0x[0-9a-f]+ \((?P<kind>\w+)\)\s*:(?P<rest>.*)$")
_FIELD = re.compile(r"(\w+)=(-?\d+)")
_MANUAL_EXPOSURE = 1

# One thing under the names that kernels gave it over the years, the newest first; what it is set to, so that nothing
# changes while a drive is recorded. The automatics come first: until they are off, a camera refuses their values.
AUTOMATICS: tuple[tuple[tuple[str, ...], int], ...] = (
    (("auto_exposure", "exposure_auto"), _MANUAL_EXPOSURE),
    (("exposure_dynamic_framerate", "exposure_auto_priority"), 0),
    (("white_balance_automatic", "white_balance_temperature_auto", "auto_white_balance"), 0),
    (("gain_automatic", "autogain"), 0),
    (("focus_automatic_continuous", "focus_auto"), 0),
)
VALUES: tuple[tuple[str, ...], ...] = (
    ("exposure_time_absolute", "exposure_absolute"),
    ("white_balance_temperature",),
    ("gain",),
    ("brightness",),
    ("contrast",),
    ("saturation",),
    ("gamma",),
    ("sharpness",),
    ("backlight_compensation",),
    ("power_line_frequency",),
)
EXPOSURES = VALUES[0]
EXPOSURE_UNIT_S = 1e-4

Controls = dict[str, int]
"""Values by name, in the order in which they are set."""


@dataclass(frozen=True)
class Control:
    """One control of a camera: kind "int", "bool", "menu"; least, most where it says so."""

    name: str
    kind: str
    value: int | None
    least: int | None = None
    most: int | None = None


def parse_controls(listing: str) -> dict[str, Control]:
    """The controls of `v4l2-ctl --list-ctrls`, by name; lines of anything else are left out."""
    found = {}
    for line in listing.splitlines():
        match = _LINE.match(line)
        if match is None:
            continue
        fields = {name: int(value) for name, value in _FIELD.findall(match["rest"])}
        found[match["name"]] = Control(
            match["name"], match["kind"], fields.get("value"), fields.get("min"), fields.get("max")
        )
    return found


def read_controls(node: str) -> dict[str, Control]:
    """The node's controls; {} where they cannot be read."""
    done = _v4l2_ctl(node, "--list-ctrls")
    return parse_controls(done.stdout) if done is not None and done.returncode == 0 else {}


def chosen_controls(present: dict[str, Control], period_s: float, exposure_s: float | None = None) -> Controls:
    """What to set so that both cameras see alike: no automatics, and this camera's values as they are now.

    exposure_s: instead of what the automatic has come to; never longer than a picture's period, which would slow the
    camera down.
    """
    chosen: Controls = {}
    for names, value in AUTOMATICS:
        control = _first(present, names)
        if control is not None:
            chosen[control.name] = value
    for names in VALUES:
        control = _first(present, names)
        if control is None or control.value is None:
            continue
        wanted = control.value
        if names is EXPOSURES:
            seconds = exposure_s if exposure_s is not None else wanted * EXPOSURE_UNIT_S
            wanted = round(min(seconds, period_s) / EXPOSURE_UNIT_S)
        chosen[control.name] = _clamped(wanted, control)
    return chosen


def set_controls(node: str, controls: Controls) -> dict[str, Any]:
    """Set them one by one and read them back: {"set": {name: value}, "refused": {name: why}}, or a "warning"."""
    if shutil.which("v4l2-ctl") is None:
        return {"warning": ABSENT}
    refused = {}
    for name, value in controls.items():
        done = _v4l2_ctl(node, "--set-ctrl", f"{name}={value}")
        if done is None or done.returncode != 0:
            refused[name] = "no answer" if done is None else _last_line(done.stderr or done.stdout)
    now = read_controls(node)
    kept = {name: now[name].value for name in controls if name in now and name not in refused}
    refused.update({name: f"is {kept[name]}" for name in kept if kept[name] != controls[name]})
    return {"set": {name: value for name, value in kept.items() if name not in refused}, "refused": refused}


def lock_controls(
    nodes: tuple[str, str], period_s: float, exposure_s: float | None = None
) -> tuple[Controls, dict[str, Any]]:
    """Choose from the first camera what both shall have and set it in both: the choice, and by node how it went."""
    if shutil.which("v4l2-ctl") is None:
        return {}, {"warning": ABSENT}
    chosen = chosen_controls(read_controls(nodes[0]), period_s, exposure_s)
    if not chosen:
        return {}, {"warning": f"{nodes[0]} has no controls of exposure and white balance"}
    return chosen, {node: set_controls(node, chosen) for node in nodes}


def _first(present: dict[str, Control], names: tuple[str, ...]) -> Control | None:
    return next((present[name] for name in names if name in present), None)


def _last_line(text: str) -> str:
    return "".join(text.strip().splitlines()[-1:])


def _clamped(value: int, control: Control) -> int:
    least = value if control.least is None else max(value, control.least)
    return least if control.most is None else min(least, control.most)


def _v4l2_ctl(node: str, *arguments: str) -> "subprocess.CompletedProcess[str] | None":
    """Its answer; None where it is not installed or does not answer."""
    try:
        return subprocess.run(
            ["v4l2-ctl", "-d", node, *arguments],
            capture_output=True,
            text=True,
            errors="replace",
            timeout=PATIENCE_S,
            stdin=subprocess.DEVNULL,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
