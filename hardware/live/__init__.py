"""Mapping while the robot drives."""
