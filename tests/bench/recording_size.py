"""What a raw pair costs in a recording, as PNG or as an uncompressed Image with zstd: bytes, and CPU of the writer.

python tests/bench/recording_size.py path/to/a/recording [--pairs 20]
"""

import argparse
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
import zstandard

from stereogrid.recording import RawReport, RawWriter, open_recording

REPORTS_A_PAIR = 2


def pairs_of(path: Path, count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Grey pairs of a recording."""
    return [(each.left, each.right) for each, _ in zip(open_recording(path), range(count), strict=False)]


def main() -> None:
    """Print a table, one row a way of writing."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recording", type=Path)
    parser.add_argument("--pairs", type=int, default=20)
    arguments = parser.parse_args()
    pairs = pairs_of(arguments.recording, arguments.pairs)
    height, width = pairs[0][0].shape
    print(f"{len(pairs)} pairs of {width} x {height} px")  # noqa: T201
    ways = {"PNG": png, "PNG, zstd 1": lambda pair: zstd(png(pair), 1), "PNG, zstd 3": lambda pair: zstd(png(pair), 3)}
    ways |= {f"Image, zstd {level}": lambda pair, level=level: zstd(plain(pair), level) for level in (1, 3, 6, 9)}
    for name, way in ways.items():
        start_s = time.process_time()
        n_bytes = sum(len(way(pair)) for pair in pairs)
        cpu_ms = 1e3 * (time.process_time() - start_s) / len(pairs)
        print(f"{name:14} {n_bytes / len(pairs) / 1e3:8.1f} kB a pair {cpu_ms:7.2f} ms of CPU")  # noqa: T201
    whole(pairs)


def png(pair: tuple[np.ndarray, np.ndarray]) -> bytes:
    """Both pictures as our writers encode them."""
    return b"".join(cv2.imencode(".png", picture)[1].tobytes() for picture in pair)


def plain(pair: tuple[np.ndarray, np.ndarray]) -> bytes:
    """Both pictures as sensor_msgs/Image has them."""
    return b"".join(picture.tobytes() for picture in pair)


def zstd(data: bytes, level: int) -> bytes:
    """As a chunk is compressed."""
    return zstandard.compress(data, level)


def whole(pairs: list[tuple[np.ndarray, np.ndarray]]) -> None:
    """The recorder's writer itself, with a robot's reports."""
    told = {"sonar_m": {k: 1.0 + k for k in range(8)}, "battery_v": 12.0, "values": {"motors": "on", "e-stop": ""}}
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.mcap"
        with RawWriter(path, None, np.eye(4)) as writer:
            before_s, at = time.process_time(), writer.n_bytes
            for number, pair in enumerate(pairs):
                writer.write_pair(*pair, number, number)
            cpu_ms = 1e3 * (time.process_time() - before_s) / len(pairs)
            print(f"RawWriter      {(writer.n_bytes - at) / len(pairs) / 1e3:8.1f} kB a pair {cpu_ms:7.2f} ms of CPU")  # noqa: T201
            before_s, at, count = time.process_time(), writer.n_bytes, REPORTS_A_PAIR * len(pairs)
            for number in range(count):
                writer.write_report(RawReport(1000 + number, np.eye(4), **told))
            cpu_ms = 1e3 * (time.process_time() - before_s) / count
            print(f"RawWriter      {(writer.n_bytes - at) / count / 1e3:8.2f} kB a report {cpu_ms:5.2f} ms of CPU")  # noqa: T201


if __name__ == "__main__":
    main()
