"""Every reader of foreign bytes, by name."""

import file_targets
import recording_targets
import robot_targets

TARGETS = {**robot_targets.TARGETS, **file_targets.TARGETS, **recording_targets.TARGETS}
