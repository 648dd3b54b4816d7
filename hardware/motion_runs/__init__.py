"""Driving the same line or turn again and again, and noting where the robot really was: for its motion error."""
