"""The metadata.yaml that makes a folder with an MCAP file a bag of ROS 2."""

import json
from pathlib import Path

from mcap.reader import make_reader
from mcap.records import Channel

from ..errors import RecordingError

VERSION = 5
"""Of the format: Humble's, which all later ones read."""


def bag_file_name(folder: Path) -> str:
    """What `ros2 bag record` calls the file in a folder."""
    return f"{folder.name}_0.mcap"


def metadata_yaml(file: Path) -> str:
    """The metadata.yaml for a finished MCAP file of ROS 2 messages, which lies in the same folder.

    Raises RecordingError when the file has no index.
    """
    with file.open("rb") as opened:
        summary = make_reader(opened).get_summary()
    if summary is None or summary.statistics is None:
        raise RecordingError(f"{file}: has no index")
    counts = summary.statistics
    start_ns, span_ns = counts.message_start_time, counts.message_end_time - counts.message_start_time
    name = json.dumps(file.name)
    topics = [
        _topic(channel, summary.schemas[channel.schema_id].name, counts.channel_message_counts.get(channel.id, 0))
        for channel in summary.channels.values()
    ]
    return f"""rosbag2_bagfile_information:
  version: {VERSION}
  storage_identifier: mcap
  duration:
    nanoseconds: {span_ns}
  starting_time:
    nanoseconds_since_epoch: {start_ns}
  message_count: {counts.message_count}
  topics_with_message_count:
{"".join(topics)}  compression_format: ""
  compression_mode: ""
  relative_file_paths:
    - {name}
  files:
    - path: {name}
      starting_time:
        nanoseconds_since_epoch: {start_ns}
      duration:
        nanoseconds: {span_ns}
      message_count: {counts.message_count}
"""


def _topic(channel: Channel, type_name: str, count: int) -> str:
    return f"""    - topic_metadata:
        name: {json.dumps(channel.topic)}
        type: {type_name}
        serialization_format: cdr
        offered_qos_profiles: {json.dumps(channel.metadata.get("offered_qos_profiles", ""))}
      message_count: {count}
"""
