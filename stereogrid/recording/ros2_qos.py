"""What a topic's publisher promised, as `ros2 bag` keeps it with each topic: `ros2 bag play` offers the same again."""

_FOR_EVER = "{sec: 9223372036, nsec: 854775807}"
_VOLATILE, _TRANSIENT_LOCAL = 2, 1
_LATCHED = ("/tf_static",)
"""Topics of which whoever comes late gets the last message."""


def offered_qos(topic: str) -> str:
    """The YAML text of `offered_qos_profiles`: reliable, the last ten kept, with the numbers that ROS 2 up to Iron has
    for it and that all later ones read."""
    durability = _TRANSIENT_LOCAL if topic in _LATCHED else _VOLATILE
    lines = (
        "history: 1",
        "depth: 10",
        "reliability: 1",
        f"durability: {durability}",
        f"deadline: {_FOR_EVER}",
        f"lifespan: {_FOR_EVER}",
        "liveliness: 1",
        f"liveliness_lease_duration: {_FOR_EVER}",
        "avoid_ros_namespace_conventions: false",
    )
    return "- " + "\n  ".join(lines)
