"""The devices of the guest: loaded when a test first asks for them, and there until the guest is off."""

import subprocess
from collections.abc import Iterator

import fake_minoru
import pytest
from fake_minoru import FakeCamera
from vivid import Vivid


@pytest.fixture(scope="session")
def _vivid() -> Vivid:
    return Vivid()


@pytest.fixture
def vivid(_vivid: Vivid) -> Iterator[Vivid]:
    """Two cameras as they are when plugged in new; unplugged afterwards, for who counts cameras."""
    _vivid.renew()
    yield _vivid
    _vivid.unplug()


@pytest.fixture(scope="session")
def _minoru() -> tuple[FakeCamera, FakeCamera]:
    fake_minoru.prepare(2)
    first, second = (FakeCamera(index, product) for index, product in enumerate(fake_minoru.PRODUCT_IDS))
    return first, second


@pytest.fixture
def minoru(_minoru: tuple[FakeCamera, FakeCamera]) -> Iterator[tuple[FakeCamera, FakeCamera]]:
    """The cameras 0ac8:3410 and 0ac8:3420, not plugged in yet."""
    yield _minoru
    for camera in _minoru:
        camera.unplug()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Iterator[None]:
    """With a failure, what the kernel said last."""
    report = yield
    if report.failed:
        said = subprocess.run(["busybox", "dmesg"], capture_output=True, text=True).stdout
        report.sections.append(("kernel", "\n".join(said.splitlines()[-20:])))
    return report
