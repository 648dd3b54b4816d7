"""A headless Chromium on one page, asked by its DevTools protocol."""

import base64
import json
import re
import shutil
import subprocess
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from websockets.sync.client import connect

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
FLAGS = (
    *("--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
)


class Browser:
    """On url, with its profile in folder; size: of the window [px]."""

    def __init__(self, url: str, folder: Path, size: tuple[int, int] = (640, 400)) -> None:
        window = f"--window-size={size[0]},{size[1]}"
        command = [str(CHROMIUM), *FLAGS, window, f"--user-data-dir={folder}", "--remote-debugging-port=0"]
        self.process = subprocess.Popen([*command, "about:blank"], stderr=subprocess.PIPE, text=True)
        assert self.process.stderr is not None
        port = next(found[1] for line in self.process.stderr if (found := re.search(r"127\.0\.0\.1:(\d+)/", line)))
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
            pages = [page for page in json.load(answer) if page["type"] == "page"]
        self._socket = connect(pages[0]["webSocketDebuggerUrl"], max_size=None)
        self._n = 0
        self.ask("Page.navigate", url=url)

    def ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._n += 1
        self._socket.send(json.dumps({"id": self._n, "method": method, "params": parameters}))
        while (answer := json.loads(self._socket.recv(60))).get("id") != self._n:
            pass
        assert "result" in answer, f"{method}: {answer}"
        result: dict[str, Any] = answer["result"]
        return result

    def text(self) -> str:
        shown = self.ask("Runtime.evaluate", expression="document.body ? document.body.innerText : ''")
        return str(shown["result"].get("value", ""))

    def picture(self) -> np.ndarray:
        png = base64.b64decode(self.ask("Page.captureScreenshot")["data"])
        return np.asarray(cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR))

    def close(self) -> None:
        self._socket.close()
        self.process.kill()
        self.process.wait()


def until(true: Callable[[], object], within_s: float = 90.0) -> None:
    end_s = time.monotonic() + within_s
    while not true():
        assert time.monotonic() < end_s, "it did not happen"
        time.sleep(0.2)
