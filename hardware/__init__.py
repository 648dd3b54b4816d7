"""The real robot: its driver, its cameras, their calibration, recordings and live maps."""
