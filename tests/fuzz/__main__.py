"""`python tests/fuzz --minutes 10`: each reader of foreign bytes in a process of its own, for minutes of its CPU time.

Inputs that break a rule stay in runs/fuzz/, to be given to `--replay`. Engines: "mutated", seeded changes of sound
inputs; "atheris", libFuzzer's, led by coverage, where `pip install atheris` was done.
"""

import argparse
import hashlib
import json
import resource
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(HERE), str(HERE.parent / "helpers"), str(ROOT)]
FOUND = ROOT / "runs" / "fuzz"
INSTRUMENTED = [
    *("arcos", "hardware", "mcap", "mcap_ros2", "rosbags", "ruamel", "trimesh.exchange", "stereogrid.calibration"),
    *("stereogrid.recording", "stereogrid.tomlfile", "stereogrid.motion.runs_csv", "stereogrid.grid.mapfile"),
]
"""Not what Numba compiles: it does not know the added instructions."""


def main() -> int:
    """Run what was asked for; 1 when a rule was broken."""
    options = _options()
    if options.one:
        return _one(options)
    if options.replay:
        return _replay(options)
    from targets import TARGETS

    names = options.names or list(TARGETS)
    unknown = [name for name in names if name not in TARGETS]
    if unknown:
        print(f"error: no reader named {unknown[0]!r}; choose from: {', '.join(TARGETS)}", file=sys.stderr)
        return 1
    print("reader                   inputs  answered   broken  slowest [ms]  memory [MB]  CPU [s]")
    broken = [_run(name, options) for name in names]
    return int(any(broken))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python tests/fuzz", description=__doc__)
    parser.add_argument("names", nargs="*", help="readers; all when none is named")
    parser.add_argument("--minutes", type=float, default=10.0, help="of CPU time for each reader")
    parser.add_argument("--engine", choices=("mutated", "atheris"), default="mutated")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--replay", type=Path, help="an input in runs/fuzz/: show what it does")
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    return parser.parse_args()


def _run(name: str, options: argparse.Namespace) -> bool:
    """One reader in a process of its own; whether it broke a rule."""
    asked = ["--minutes", str(options.minutes), "--engine", options.engine, "--seed", str(options.seed)]
    line = [sys.executable, str(HERE), name, "--one", *asked]
    done = subprocess.run(line, capture_output=True, text=True, cwd=ROOT)
    last = done.stdout.strip().splitlines()[-1:] or [""]
    try:
        told = json.loads(last[0])
    except ValueError:
        FOUND.mkdir(parents=True, exist_ok=True)
        (FOUND / f"{name}.log").write_text(done.stderr[-20_000:])
        print(f"{name:20} ended with {done.returncode}: see {FOUND / name}.log", flush=True)
        return True
    told_of = ("inputs", "answered", "broken", "slowest_ms", "memory_mb", "cpu_s")
    inputs, answered, broken, slowest_ms, memory_mb, cpu_s = (told[key] for key in told_of)
    figures = f"{inputs:>10,} {answered:>9,} {broken:>8} {slowest_ms:>13.0f} {memory_mb:>12.0f} {cpu_s:>8.0f}"
    print(f"{name:20} {figures}", flush=True)
    for each in told["findings"]:
        print(f"    {each}", flush=True)
    return bool(broken)


def _one(options: argparse.Namespace) -> int:
    (name,) = options.names
    if options.engine == "atheris":
        from by_coverage import fuzz

        return fuzz(name, options.minutes, INSTRUMENTED, FOUND)
    with tempfile.TemporaryDirectory() as folder:
        print(json.dumps(_mutate(name, options, Path(folder))))
    return 0


def _mutate(name: str, options: argparse.Namespace, folder: Path) -> dict[str, object]:
    """Changed samples until the time is over. Each way in which a rule is broken is kept once."""
    import numpy as np
    from mutation import mutated
    from target import Watch, attempt
    from targets import TARGETS

    warnings.simplefilter("error", RuntimeWarning)
    target, rng, watch = TARGETS[name], np.random.default_rng([options.seed, *name.encode()]), Watch()
    samples = target.samples(folder)
    for sample in samples:
        target.read(sample, folder)
    inputs, answered, slowest_s, findings, broken = 0, 0, 0.0, {}, 0
    start_s = time.process_time()
    while time.process_time() - start_s < 60 * options.minutes:
        data, began_s = mutated(samples, rng), time.perf_counter()
        try:
            answered += attempt(target, data, folder, watch)
        except Exception as error:
            broken += 1
            where = traceback.extract_tb(error.__traceback__)[-1]
            what = f"{type(error).__name__} at {Path(where.filename).name}:{where.lineno}: {str(error)[:100]}"
            findings.setdefault(what.split(":", 2)[0] + str(where.lineno), f"{what} [{_keep(name, data)}]")
        inputs, slowest_s = inputs + 1, max(slowest_s, time.perf_counter() - began_s)
    memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    counts = {"inputs": inputs, "answered": answered, "broken": broken, "findings": list(findings.values())}
    return {**counts, "slowest_ms": 1e3 * slowest_s, "memory_mb": memory_mb, "cpu_s": time.process_time() - start_s}


def _keep(name: str, data: bytes) -> str:
    FOUND.mkdir(parents=True, exist_ok=True)
    path = FOUND / f"{name}-{hashlib.sha256(data).hexdigest()[:12]}"
    path.write_bytes(data)
    return str(path.relative_to(ROOT))


def _replay(options: argparse.Namespace) -> int:
    from target import Watch, attempt
    from targets import TARGETS

    warnings.simplefilter("error", RuntimeWarning)
    name = options.replay.name.rpartition("-")[0]
    with tempfile.TemporaryDirectory() as folder:
        TARGETS[name].samples(Path(folder))
        print("answered" if attempt(TARGETS[name], options.replay.read_bytes(), Path(folder), Watch()) else "refused")
    return 0


if __name__ == "__main__":
    sys.exit(main())
