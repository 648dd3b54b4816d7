"""The same readers and rules, with inputs that libFuzzer finds: it looks for those that reach new code."""

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

STATISTIC = re.compile(r"stat::(\w+):\s+(\d+)")
INSIDE = """
import sys, atheris, warnings
from pathlib import Path
sys.path[:0] = {paths!r}
with atheris.instrument_imports(include={instrumented!r}):
    from targets import TARGETS
from target import Watch, attempt
warnings.simplefilter("error", RuntimeWarning)
target, folder, watch = TARGETS[{name!r}], Path({folder!r}), Watch()
corpus = Path({corpus!r})
for n, sample in enumerate(target.samples(folder)):
    target.read(sample, folder)
    (corpus / str(n)).write_bytes(sample)
atheris.Setup(sys.argv, lambda data: attempt(target, data, folder, watch) and None)
atheris.Fuzz()
"""


def fuzz(name: str, minutes: float, instrumented: list[str], found: Path) -> int:
    """Until the time is over or a rule is broken; prints the figures as JSON."""
    found.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as corpus:
        code = INSIDE.format(paths=sys.path[:3], instrumented=instrumented, name=name, folder=folder, corpus=corpus)
        limits = [f"-max_total_time={60 * minutes:.0f}", "-max_len=100000", "-timeout=30", "-rss_limit_mb=4096"]
        line = [
            sys.executable,
            "-c",
            code,
            *limits,
            "-print_final_stats=1",
            f"-artifact_prefix={found}/{name}-",
            corpus,
        ]
        done = subprocess.run(line, capture_output=True, text=True)
    stats = {key: int(value) for key, value in STATISTIC.findall(done.stderr)}
    finding = [line for line in done.stderr.splitlines() if "Error" in line or "Exception" in line][:1]
    counts = {"inputs": stats.get("number_of_executed_units", 0), "answered": 0, "broken": int(done.returncode != 0)}
    if done.returncode and not stats:
        finding = [done.stderr[-300:]]
    figures = {"slowest_ms": 1e3 * stats.get("slowest_unit_time_sec", 0), "memory_mb": stats.get("peak_rss_mb", 0)}
    print(json.dumps({**counts, **figures, "cpu_s": 60 * minutes, "findings": finding if done.returncode else []}))
    return 0
