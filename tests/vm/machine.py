"""QEMU without KVM: boots, runs one command among the host's own files (read-only, over 9p), gives its exit status."""

import platform
import secrets
import shlex
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from debian_kernel import TO_BOOT, VmError, unpacked

# Program -> Debian's package.
PROGRAMS = {
    "qemu-system-x86_64": "qemu-system-x86",
    "busybox": "busybox-static",
    "v4l2-ctl": "v4l-utils",
    "apt-get": "apt",
    "dpkg": "dpkg",
}
# On top of the command's own limit: to boot, and to give up.
BOOT_LIMIT_S = 180.0
# Read where the guest's /tmp is a new one.
TMP = Path("/tmp")


def check_host() -> None:
    """Raises VmError with one line: every package that is absent, by its name, or another kind of CPU."""
    if platform.machine() != "x86_64":
        raise VmError(f"the virtual machine runs this host's programs on x86-64, and this host is {platform.machine()}")
    missing = [package for program, package in PROGRAMS.items() if not shutil.which(program)]
    busybox = shutil.which("busybox")
    if busybox and b"/ld-linux" in Path(busybox).read_bytes()[:4096]:
        missing.append("busybox-static (busybox is there, but needs shared libraries)")
    if missing:
        raise VmError(f"the virtual machine needs the Debian packages: {', '.join(missing)}")


@dataclass(frozen=True)
class Machine:
    """A guest of some CPUs and memory. cache: where the kernel is kept; console: where kernel messages go."""

    cache: Path
    console: Path
    cpus: int = 2
    memory_mb: int = 1536

    def run(self, command: list[str], *, folder: Path, time_limit_s: float, say: Callable[[str], None]) -> int:
        """The exit status of command, which runs in folder; say gets each line that it says.

        Raises VmError where the guest does not come up, or dies, or is not done in time.
        """
        kernel = unpacked(self.cache)
        mark = f"stereogrid-vm-{secrets.token_hex(8)}"
        with tempfile.TemporaryDirectory() as made:
            initramfs = Path(made) / "initramfs"
            script = _script(command, folder, kernel)
            settings = {"KEPT": " ".join(map(str, _kept(folder))), "TIME_LIMIT_S": int(time_limit_s), "MARK": mark}
            _write_initramfs(initramfs, kernel, script=script, settings=settings)
            end = watched(self._qemu(kernel, initramfs), mark, time_limit_s + BOOT_LIMIT_S, say)
        if not end.lstrip("-").isdigit():
            raise VmError(f"the virtual machine was stopped ({end}); its kernel's messages: {self.console}")
        return int(end)

    def _qemu(self, kernel: Path, initramfs: Path) -> list[str]:
        return [
            *("qemu-system-x86_64", "-accel", "tcg,thread=multi", "-cpu", "Nehalem"),
            *("-smp", str(self.cpus), "-m", str(self.memory_mb)),
            *("-nodefaults", "-no-user-config", "-no-reboot", "-display", "none"),
            *("-kernel", str(kernel / "vmlinuz"), "-initrd", str(initramfs)),
            *("-append", "console=ttyS0 quiet panic=-1 mitigations=off nokaslr"),
            *("-serial", f"file:{self.console}", "-serial", "stdio"),
            *("-virtfs", "local,path=/,mount_tag=host,security_model=none,readonly=on,multidevs=remap"),
        ]


def _kept(folder: Path) -> list[Path]:
    """The folders below /tmp that must stay visible: where the command runs, and the Python that runs it."""
    wanted = {folder.resolve(), *(Path(prefix).resolve() for prefix in (sys.prefix, sys.base_prefix))}
    return sorted(path for path in wanted if path.is_relative_to(TMP))


def _script(command: list[str], folder: Path, kernel: Path) -> str:
    variables = {
        "PATH": "/usr/sbin:/usr/bin:/sbin:/bin",
        "HOME": "/tmp",
        "TMPDIR": "/tmp",
        "LANG": "C.UTF-8",
        "PYTHONPATH": str(folder),
        "PYTHONDONTWRITEBYTECODE": "1",
        "PYTHONUNBUFFERED": "1",
        "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1",
        "NUMBA_CACHE_DIR": "/tmp/numba",
        "STEREOGRID_VM_MODULES": str(kernel),
    }
    lines = [f"export {name}={shlex.quote(value)}" for name, value in variables.items()]
    return "\n".join([*lines, f"cd {shlex.quote(str(folder))}", f"exec {shlex.join(command)}", ""])


def _write_initramfs(path: Path, kernel: Path, *, script: str, settings: dict[str, object]) -> None:
    root = path.with_name("root")
    for folder in ("bin", "proc", "dev", "host", "kept", "modules"):
        (root / folder).mkdir(parents=True)
    busybox = shutil.which("busybox") or "busybox"
    shutil.copy(busybox, root / "bin/busybox")
    for applet in subprocess.check_output([busybox, "--list"], text=True).split():
        if applet != "busybox":
            (root / "bin" / applet).symlink_to("busybox")
    order = dict.fromkeys(name for boot in TO_BOOT for name in (kernel / f"{boot}.load").read_text().split())
    for name in order:
        shutil.copy(kernel / name, root / "modules" / name)
    (root / "modules/order").write_text("\n".join(order))
    (root / "settings").write_text("".join(f"{key}={shlex.quote(str(value))}\n" for key, value in settings.items()))
    (root / "command").write_text(script)
    shutil.copy(Path(__file__).with_name("guest_init.sh"), root / "init")
    (root / "init").chmod(0o755)
    names = "\n".join(str(file.relative_to(root)) for file in sorted(root.rglob("*"))).encode()
    with path.open("wb") as archive:
        subprocess.run([busybox, "cpio", "-o", "-H", "newc"], input=names, stdout=archive, cwd=root, check=True)


def watched(qemu: list[str], mark: str, time_limit_s: float, say: Callable[[str], None]) -> str:
    """What follows the mark in what the guest says; kills the machine when the time is over."""
    late = threading.Event()
    end = "no exit status came"
    with subprocess.Popen(qemu, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:

        def stop() -> None:
            late.set()
            process.kill()

        watchdog = threading.Timer(time_limit_s, stop)
        watchdog.start()
        try:
            for line in process.stdout or ():
                text = line.decode(errors="replace").rstrip()
                if text.startswith(mark):
                    end = text.removeprefix(mark).strip()
                else:
                    say(text)
        finally:
            watchdog.cancel()
            process.kill()
    return f"not done in {time_limit_s:g} s" if late.is_set() else end
