"""Write golden_graphcut.json anew; the command stands in it."""

import json
import sys
from pathlib import Path

from test_graphcut import GOLDEN, PAIRS, measure

stereo = Path(sys.argv[1]) / "stereo"
golden = {
    "command": "PYTHONPATH=.:tests/helpers python tests/unit/matching/measure_golden_graphcut.py ../shared/data",
    "pairs": {pair: measure(stereo / pair) for pair in PAIRS},
}
GOLDEN.write_text(json.dumps(golden, indent=2) + "\n", encoding="utf-8")
