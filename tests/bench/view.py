"""What `stereogrid view` costs with a large map, in a browser without a graphics card:

python tests/bench/view.py 1000000 [10000000 ...]

A hilly sheet of so many occupied cells; Chromium draws by SwiftShader, on the processors.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))
from browsers import Browser, until

from stereogrid.grid import OccupancyGrid
from stereogrid.viewer import MapPage, subject_of_map

MOVES = 40


def hills(n: int) -> OccupancyGrid:
    """A map of about n occupied cells of 5 cm, of probabilities .6 to 1."""
    side = int(np.sqrt(n))
    i, j = np.meshgrid(np.arange(side) - side // 2, np.arange(side) - side // 2, indexing="ij")
    k = np.rint(12 * np.sin(i / 23) * np.cos(j / 31)).astype(int)
    cells = np.stack([i.ravel(), j.ravel(), k.ravel()], axis=1)
    odds = np.random.default_rng(1).uniform(0.5, 5, len(cells))
    return OccupancyGrid.from_cells(0.05, cells, odds, memory_limit_gb=8)


def coloured(browser: Browser) -> int:
    try:
        picture = browser.picture()[:, :900].astype(int)
    except AssertionError:  # the browser is too busy to be pictured
        return 0
    return int(np.count_nonzero(picture.max(axis=2) - picture.min(axis=2) > 40))


def memory_mb(process: subprocess.Popen) -> float:
    """Of a browser and all its processes, resident, what they share counted once for each [MB]."""
    listed = subprocess.run(["ps", "-eo", "pid,ppid,rss"], capture_output=True, text=True, check=True).stdout
    rows = [tuple(map(int, line.split())) for line in listed.splitlines()[1:]]
    own = {process.pid}
    for _ in range(5):
        own |= {pid for pid, parent, _ in rows if parent in own}
    return sum(rss for pid, _, rss in rows if pid in own) / 1024


def frames_per_s(browser: Browser) -> float:
    """While the mouse turns the view."""
    count = "window.n = 0; (function f() { window.n++; requestAnimationFrame(f) })()"
    browser.ask("Runtime.evaluate", expression=count)
    browser.ask("Input.dispatchMouseEvent", type="mousePressed", x=400, y=400, button="left", clickCount=1)
    start_s = time.monotonic()
    for n in range(MOVES):
        browser.ask("Input.dispatchMouseEvent", type="mouseMoved", x=400 + 3 * n, y=400, button="left", buttons=1)
        time.sleep(0.05)
    frames = browser.ask("Runtime.evaluate", expression="window.n")["result"]["value"]
    took_s = time.monotonic() - start_s
    browser.ask("Input.dispatchMouseEvent", type="mouseReleased", x=520, y=400, button="left")
    return float(frames / took_s)


def say(line: str) -> None:
    """At once: a run may be ended early."""
    print(line, flush=True)  # noqa: T201


def measure(n: int, folder: Path) -> None:
    path = hills(n).save(folder / "hills.sgrid")
    start_s = time.monotonic()
    with MapPage(subject_of_map(path)) as page:
        until(lambda: page.drawn or page.fault)
        say(f"{n:,} cells: {page.drawn:,} drawn; read and sent after {time.monotonic() - start_s:.1f} s")
        start_s = time.monotonic()
        browser = Browser(page.url, folder / "profile", (1280, 800))
        try:
            until(lambda: coloured(browser) > 5000, 300)
            say(f"first picture {time.monotonic() - start_s:.1f} s after the browser began")
            before, start_s = page.drawn, time.monotonic()
            page.controls._threshold.value = 0.9
            page.controls._changed()
            until(lambda: page.drawn != before, 60)
            sent_s = time.monotonic() - start_s
            browser.ask("Runtime.evaluate", expression="new Promise(requestAnimationFrame)", awaitPromise=True)
            say(f"threshold: new cells sent after {sent_s:.2f} s, drawn after {time.monotonic() - start_s:.1f} s")
            server_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            say(f"{frames_per_s(browser):.1f} frames/s; browser {memory_mb(browser.process):.0f} MB")
            say(f"server at most {server_mb:.0f} MB; load {os.getloadavg()[0]:.1f}")
            words = [line for line in browser.text().splitlines() if " cells of " in line]
            say("\n".join(words))
        finally:
            browser.close()


if __name__ == "__main__":
    for count in sys.argv[1:]:
        with tempfile.TemporaryDirectory() as place:
            measure(int(count), Path(place))
