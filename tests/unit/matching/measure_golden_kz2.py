"""Write golden_kz2.json anew; the command stands in it."""

import json
import sys
from pathlib import Path

from test_kz2 import BEST_OF_REFERENCE, GOLDEN, measure

stereo = Path(sys.argv[1]) / "stereo"
golden = {
    "command": "PYTHONPATH=.:tests/helpers python tests/unit/matching/measure_golden_kz2.py ../shared/data",
    "pairs": {pair: measure(stereo / pair) for pair in BEST_OF_REFERENCE},
}
GOLDEN.write_text(json.dumps(golden, indent=2) + "\n", encoding="utf-8")
