"""The ROS 2 message definitions that a recording uses, as rosbag2 writes them (comments left out)."""

_HEADER = "builtin_interfaces/Time stamp\nstring frame_id"
_VECTOR3 = "float64 x\nfloat64 y\nfloat64 z"
_QUATERNION = "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1"

_PARTS = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "std_msgs/Header": _HEADER,
    "geometry_msgs/Point": _VECTOR3,
    "geometry_msgs/Vector3": _VECTOR3,
    "geometry_msgs/Quaternion": _QUATERNION,
    "geometry_msgs/Pose": "Point position\nQuaternion orientation",
    "geometry_msgs/PoseWithCovariance": "Pose pose\nfloat64[36] covariance",
    "geometry_msgs/Twist": "Vector3 linear\nVector3 angular",
    "geometry_msgs/TwistWithCovariance": "Twist twist\nfloat64[36] covariance",
    "geometry_msgs/Transform": "Vector3 translation\nQuaternion rotation",
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform"
    ),
    "diagnostic_msgs/KeyValue": "string key\nstring value",
    "diagnostic_msgs/DiagnosticStatus": (
        "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\n"
        "byte level\nstring name\nstring message\nstring hardware_id\nKeyValue[] values"
    ),
    "sensor_msgs/RegionOfInterest": ("uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify"),
}

_STAMPED = ("std_msgs/Header", "builtin_interfaces/Time")
_POSE = ("geometry_msgs/Pose", "geometry_msgs/Point", "geometry_msgs/Quaternion")


_POWER_SUPPLY = {
    "STATUS": ("UNKNOWN", "CHARGING", "DISCHARGING", "NOT_CHARGING", "FULL"),
    "HEALTH": (
        *("UNKNOWN", "GOOD", "OVERHEAT", "DEAD", "OVERVOLTAGE", "UNSPEC_FAILURE", "COLD"),
        *("WATCHDOG_TIMER_EXPIRE", "SAFETY_TIMER_EXPIRE"),
    ),
    "TECHNOLOGY": ("UNKNOWN", "NIMH", "LION", "LIPO", "LIFE", "NICD", "LIMN"),
}
_POWER_SUPPLY_CONSTANTS = "".join(
    f"uint8 POWER_SUPPLY_{kind}_{name}={number}\n"
    for kind, names in _POWER_SUPPLY.items()
    for number, name in enumerate(names)
)


def _schema(text: str, *parts: str) -> str:
    rule = "=" * 80
    return "\n".join([text, *(f"{rule}\nMSG: {part}\n{_PARTS[part]}" for part in parts)]) + "\n"


SCHEMAS = {
    "std_msgs/msg/Header": _schema(_HEADER, "builtin_interfaces/Time"),
    "sensor_msgs/msg/CompressedImage": _schema("std_msgs/Header header\nstring format\nuint8[] data", *_STAMPED),
    "sensor_msgs/msg/Image": _schema(
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\n"
        "uint8 is_bigendian\nuint32 step\nuint8[] data",
        *_STAMPED,
    ),
    "sensor_msgs/msg/CameraInfo": _schema(
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\n"
        "float64[] d\nfloat64[9] k\nfloat64[9] r\nfloat64[12] p\n"
        "uint32 binning_x\nuint32 binning_y\nRegionOfInterest roi",
        *_STAMPED,
        "sensor_msgs/RegionOfInterest",
    ),
    "nav_msgs/msg/Odometry": _schema(
        "std_msgs/Header header\nstring child_frame_id\n"
        "geometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist",
        *_STAMPED,
        "geometry_msgs/PoseWithCovariance",
        *_POSE,
        "geometry_msgs/TwistWithCovariance",
        "geometry_msgs/Twist",
        "geometry_msgs/Vector3",
    ),
    "sensor_msgs/msg/Range": _schema(
        "uint8 ULTRASOUND=0\nuint8 INFRARED=1\nstd_msgs/Header header\nuint8 radiation_type\nfloat32 field_of_view\n"
        "float32 min_range\nfloat32 max_range\nfloat32 range\nfloat32 variance",
        *_STAMPED,
    ),
    "sensor_msgs/msg/BatteryState": _schema(
        _POWER_SUPPLY_CONSTANTS
        + "std_msgs/Header header\nfloat32 voltage\nfloat32 temperature\nfloat32 current\nfloat32 charge\n"
        "float32 capacity\nfloat32 design_capacity\nfloat32 percentage\nuint8 power_supply_status\n"
        "uint8 power_supply_health\nuint8 power_supply_technology\nbool present\nfloat32[] cell_voltage\n"
        "float32[] cell_temperature\nstring location\nstring serial_number",
        *_STAMPED,
    ),
    "diagnostic_msgs/msg/DiagnosticArray": _schema(
        "std_msgs/Header header\nDiagnosticStatus[] status",
        *_STAMPED,
        "diagnostic_msgs/DiagnosticStatus",
        "diagnostic_msgs/KeyValue",
    ),
    "sensor_msgs/msg/JointState": _schema(
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort", *_STAMPED
    ),
    "geometry_msgs/msg/PoseStamped": _schema("std_msgs/Header header\nPose pose", *_STAMPED, *_POSE),
    "geometry_msgs/msg/PoseWithCovarianceStamped": _schema(
        "std_msgs/Header header\nPoseWithCovariance pose", *_STAMPED, "geometry_msgs/PoseWithCovariance", *_POSE
    ),
    "geometry_msgs/msg/TransformStamped": _schema(
        "std_msgs/Header header\nstring child_frame_id\nTransform transform",
        *_STAMPED,
        "geometry_msgs/Transform",
        "geometry_msgs/Vector3",
        "geometry_msgs/Quaternion",
    ),
    "tf2_msgs/msg/TFMessage": _schema(
        "geometry_msgs/TransformStamped[] transforms",
        "geometry_msgs/TransformStamped",
        *_STAMPED,
        "geometry_msgs/Transform",
        "geometry_msgs/Vector3",
        "geometry_msgs/Quaternion",
    ),
}
"""Definition by full type name; std_msgs/Header is there to read any stamped message's first field alone."""
