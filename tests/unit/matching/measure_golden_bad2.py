"""Write golden_bad2.json anew: python tests/unit/matching/measure_golden_bad2.py ../shared/data."""

import json
import sys
from pathlib import Path

import cv2
from test_opencv_matchers import GOLDEN, NUM_DISPARITIES, measure

stereo = Path(sys.argv[1]) / "stereo"
golden = {
    "command": "python tests/unit/matching/measure_golden_bad2.py ../shared/data",
    "opencv": cv2.__version__,
    "pairs": {pair: {name: measure(name, stereo / pair) for name in ("bm", "sgbm")} for pair in NUM_DISPARITIES},
}
GOLDEN.write_text(json.dumps(golden, indent=2) + "\n", encoding="utf-8")
