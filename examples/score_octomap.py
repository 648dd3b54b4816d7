"""Score somebody's OctoMap: python examples/score_octomap.py map.bt drive.mcap

map.bt (or .ot): any program's map of the drive; drive.mcap: the drive, with its truth, as `python -m sim record` writes
it. The same cells are asked of every map: those that the cameras could see. Needs the extra `score`.
"""

import sys

import stereogrid as sg

if len(sys.argv) != 3:
    sys.exit(__doc__)

map_file, drive_file = sys.argv[1:]

grid = sg.OccupancyGrid.load(map_file)
truth = sg.MapTruth.of_recording(sg.open_recording(drive_file), grid.cell_m, max_range_m=5.0)

print(grid)
for score in truth.score(grid, prior=0.5):  # what an unknown cell claims
    print(f"{score.name:28} {score.text:>10} {score.unit:6} of {score.n:,}")
