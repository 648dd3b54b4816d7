"""Your own images: python examples/own_images.py left/ right/ poses.txt map.sgrid

Two folders of rectified images with the same names, and a text file with a line for each pair in the order of the
names: the left camera's pose in the world, a 3x4 matrix row by row (x right, y down, z forward; the world's z is up).
"""

import sys
from pathlib import Path

import cv2
import numpy as np

import stereogrid as sg

if len(sys.argv) != 5:
    sys.exit(__doc__)

left_folder, right_folder, poses_file, out = sys.argv[1:]

# EDIT THIS: your camera, from your calibration, after rectification.
camera = sg.StereoCamera(focal_px=200, cx_px=95.5, cy_px=71.5, baseline_m=0.12, width_px=192, height_px=144)
matcher = sg.matcher("sgbm", num_disparities=48)
grid = sg.OccupancyGrid(cell_m=0.1)

poses = np.loadtxt(poses_file).reshape(-1, 3, 4)
for path, pose in zip(sorted(Path(left_folder).iterdir()), poses, strict=True):
    left = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    right = cv2.imread(str(Path(right_folder) / path.name), cv2.IMREAD_GRAYSCALE)
    disparity = matcher.match(left, right)
    grid.integrate(camera, disparity, np.vstack([pose, [0, 0, 0, 1]]))
    print(path.name, disparity)

print(grid)
grid.save(out)  # `stereogrid view map.sgrid` shows it, `stereogrid export map.sgrid map.bt` is for OctoMap
sg.slice_figure(grid, height_m=poses[0, 2, 3]).savefig(Path(out).with_suffix(".png"))
