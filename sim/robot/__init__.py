"""The simulated Pioneer 3-AT: its physics, its senses and its wheel odometry."""
