"""A headless Chromium on one page of this machine, without a network, asked by its DevTools protocol."""

import base64
import json
import re
import shutil
import subprocess
import time
import urllib.request
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from websockets.sync.client import connect

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
FLAGS = (
    *("--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync", "--hide-scrollbars"),
)
FAULTS = ("Runtime.exceptionThrown", "Log.entryAdded", "Runtime.consoleAPICalled", "Network.loadingFailed")


class OfflinePage:
    """A file in the browser; requested: what it asked for; faults: what its console and its loads complained of."""

    def __init__(self, file: Path, profile: Path) -> None:
        command = [str(CHROMIUM), *FLAGS, f"--user-data-dir={profile}", "--remote-debugging-port=0", "about:blank"]
        self._process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        assert self._process.stderr is not None
        port = next(found[1] for line in self._process.stderr if (found := re.search(r"127\.0\.0\.1:(\d+)/", line)))
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
            pages = [page for page in json.load(answer) if page["type"] == "page"]
        self._socket = connect(pages[0]["webSocketDebuggerUrl"], max_size=None)
        self._n = 0
        self._events: list[dict[str, Any]] = []
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.ask(f"{domain}.enable")
        self.ask(
            "Network.emulateNetworkConditions", offline=True, latency=0, downloadThroughput=-1, uploadThroughput=-1
        )
        self.look()
        self.ask("Page.navigate", url=file.as_uri())
        self.until("document.readyState === 'complete'")

    def ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._n += 1
        self._socket.send(json.dumps({"id": self._n, "method": method, "params": parameters}))
        while (answer := json.loads(self._socket.recv(60))).get("id") != self._n:
            self._events.append(answer)
        assert "error" not in answer, answer
        result: dict[str, Any] = answer["result"]
        return result

    def look(self, *, scheme: str = "light", media: str = "", width_px: int = 900) -> None:
        """As a screen or paper (media "print") of that width, by day or night."""
        self.ask("Emulation.setDeviceMetricsOverride", width=width_px, height=700, deviceScaleFactor=1, mobile=False)
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        self.ask("Emulation.setEmulatedMedia", media=media, features=features)

    def value(self, code: str) -> Any:
        """Of JavaScript."""
        return self.ask("Runtime.evaluate", expression=code, returnByValue=True, awaitPromise=True)["result"].get(
            "value"
        )

    def until(self, code: str, within_s: float = 60.0) -> None:
        end_s = time.monotonic() + within_s
        while not self.value(code):
            assert time.monotonic() < end_s, f"not true within {within_s} s: {code}"
            time.sleep(0.1)

    def picture(self, element: str) -> np.ndarray:
        """Pixels (H, W, 3) of the first element of that selector."""
        where = f"JSON.stringify(document.querySelector('{element}').getBoundingClientRect())"
        self.value(f"document.querySelector('{element}').scrollIntoView()")
        box = json.loads(self.value(where))
        clip = {k: box[k] for k in ("width", "height")} | {"x": box["x"], "scale": 1}
        clip["y"] = box["y"] + self.value("scrollY")
        png = base64.b64decode(self.ask("Page.captureScreenshot", clip=clip, captureBeyondViewport=True)["data"])
        return np.asarray(cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR))

    @property
    def requested(self) -> list[str]:
        return [e["params"]["request"]["url"] for e in self._events if e["method"] == "Network.requestWillBeSent"]

    @property
    def faults(self) -> list[dict[str, Any]]:
        return [event for event in self._events if event["method"] in FAULTS]

    def close(self) -> None:
        self._socket.close()
        self._process.kill()
        self._process.wait()
