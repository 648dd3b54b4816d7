"""From live pictures or files of a chessboard to a calibration."""
