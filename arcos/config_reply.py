"""The robot's answer to CONFIG: its limits and settings."""

import struct
from dataclasses import dataclass

from .errors import ArcosError
from .fields import TEXT, Reader, check_fits, text_bytes
from .packets import BODY_MAX

CONFIG_REPLY = 0x20
_FIELDS = {
    "robot_type": TEXT,
    "subtype": TEXT,
    "serial": TEXT,
    "spare_1": "B",
    "top_turn_degps": "H",
    "top_speed_mmps": "H",
    "top_turn_acceleration_degps2": "H",
    "top_acceleration_mmps2": "H",
    "pwm_max": "H",
    "name": TEXT,
    "sip_cycle_ms": "B",
    "host_baud": "B",
    "aux1_baud": "B",
    "gripper": "H",
    "front_sonar": "H",
    "rear_sonar": "B",
    "low_battery_dv": "H",
    "rev_count": "H",
    "watchdog_ms": "H",
    "spare_2": "B",
    "stall_value": "H",
    "stall_count": "H",
    "joystick_mmps": "H",
    "joystick_turn_degps": "H",
    "max_turn_degps": "H",
    "max_speed_mmps": "H",
    "turn_acceleration_degps2": "H",
    "turn_deceleration_degps2": "H",
    "turn_kp": "H",
    "turn_kv": "H",
    "turn_ki": "H",
    "acceleration_mmps2": "H",
    "deceleration_mmps2": "H",
    "speed_kp": "H",
    "speed_kv": "H",
    "speed_ki": "H",
    "front_bumpers": "B",
    "rear_bumpers": "B",
    "charger": "B",
    "sonar_cycle": "B",
    "auto_baud": "B",
    "gyro_type": "B",
    "drift": "h",
    "aux2_baud": "B",
    "aux3_baud": "B",
    "ticks_mm": "H",
    "shutdown_dv": "H",
    "version": TEXT,
}
AUTO_BAUD = 2
"""auto_baud of a robot whose serial speed a client may switch."""


@dataclass(frozen=True)
class ConfigReply:
    """All fields in the order and the units of the wire; top_* are limits, max_* and the rest present settings.

    Bauds are indices into BAUDS. rest: bytes behind the version, an optional tail.
    """

    robot_type: str = "Pioneer"
    subtype: str = "p3at"
    serial: str = "SIM"
    spare_1: int = 0
    top_turn_degps: int = 300
    top_speed_mmps: int = 1200
    top_turn_acceleration_degps2: int = 300
    top_acceleration_mmps2: int = 2000
    pwm_max: int = 400
    name: str = ""
    sip_cycle_ms: int = 100
    host_baud: int = 0
    aux1_baud: int = 0
    gripper: int = 0
    front_sonar: int = 1
    rear_sonar: int = 1
    low_battery_dv: int = 115
    rev_count: int = 0
    watchdog_ms: int = 2000
    spare_2: int = 0
    stall_value: int = 200
    stall_count: int = 100
    joystick_mmps: int = 0
    joystick_turn_degps: int = 0
    max_turn_degps: int = 140
    max_speed_mmps: int = 700
    turn_acceleration_degps2: int = 100
    turn_deceleration_degps2: int = 100
    turn_kp: int = 0
    turn_kv: int = 0
    turn_ki: int = 0
    acceleration_mmps2: int = 300
    deceleration_mmps2: int = 300
    speed_kp: int = 0
    speed_kv: int = 0
    speed_ki: int = 0
    front_bumpers: int = 5
    rear_bumpers: int = 5
    charger: int = 0
    sonar_cycle: int = 40
    auto_baud: int = AUTO_BAUD
    gyro_type: int = 0
    drift: int = 0
    aux2_baud: int = 0
    aux3_baud: int = 0
    ticks_mm: int = 0
    shutdown_dv: int = 110
    version: str = "S.0"
    rest: bytes = b""

    def __post_init__(self) -> None:
        for name, letter in _FIELDS.items():
            if letter != TEXT:
                check_fits(name, getattr(self, name), letter)
        if len(self.body()) > BODY_MAX:
            raise ArcosError("the strings of a CONFIG reply are too long for a packet")

    def body(self) -> bytes:
        """The body of its packet."""
        return bytes([CONFIG_REPLY]) + b"".join(map(self._field, _FIELDS)) + self.rest

    def _field(self, name: str) -> bytes:
        value = getattr(self, name)
        return text_bytes(value) if _FIELDS[name] == TEXT else struct.pack(f"<{_FIELDS[name]}", value)

    @staticmethod
    def decode(body: bytes) -> "ConfigReply":
        """The reply in a packet's body. Raises ArcosError when it is none or ends before the version does."""
        if body[:1] != bytes([CONFIG_REPLY]):
            raise ArcosError("the body is no CONFIG reply")
        reader = Reader(body, 1)
        values = {name: reader.text() if f == TEXT else reader.integer(f) for name, f in _FIELDS.items()}
        return ConfigReply(**values, rest=reader.rest)  # type: ignore[arg-type]
