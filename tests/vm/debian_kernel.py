"""Debian's kernel, unpacked from its package and cut down to the modules that the tests load; nothing is installed."""

import lzma
import re
import subprocess
import tarfile
import tempfile
from pathlib import Path


class VmError(Exception):
    """The machine cannot be made or run; one line that says what is missing or went wrong."""


PACKAGE = "linux-image-amd64"
# What may be loaded in the guest; each brings the modules that it depends on.
TO_BOOT = ("virtio_pci", "9pnet_virtio", "9p")
TO_TEST = ("vivid", "uvcvideo", "libcomposite", "usb_f_uvc", "usbip-vudc", "vhci-hcd")
FOLDERS_OF_NO_USE = ("/drivers/net/", "/drivers/gpu/", "/sound/")


def unpacked(cache: Path) -> Path:
    """The folder in cache with the newest kernel that was unpacked there: vmlinuz, <module>.ko, and <module>.load, the
    names of the modules to load before it and itself, one a line, in order. Fetches it where there is none.

    Raises VmError where apt has no such package or cannot fetch it.
    """
    known = sorted(cache.glob("linux-*"))
    if known:
        return known[-1]
    cache.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=cache) as beside:
        package = _fetched(Path(beside))
        kept = Path(beside) / "kept"
        kept.mkdir()
        release = _unpack(package, kept)
        _keep_what_is_loaded(kept)
        target = cache / f"linux-{release}"
        # Another run may have been as quick.
        return target if target.exists() else kept.rename(target)


def _fetched(folder: Path) -> Path:
    """The package that linux-image-amd64 stands for, downloaded into folder."""
    depends = _asked(["apt-cache", "depends", PACKAGE], folder)
    names = re.findall(r"Depends: (linux-image-[\w.+-]+-amd64)$", depends, re.MULTILINE)
    if not names:
        raise VmError(f"{PACKAGE}, Debian's kernel, is not what apt has here")
    _asked(["apt-get", "download", names[-1]], folder)
    return next(folder.glob("*.deb"))


def _asked(command: list[str], folder: Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if done.returncode:
        why = (done.stderr.strip() or "no reason given").splitlines()[-1]
        raise VmError(f"{' '.join(command)} failed: {why} (apt-get update may help)")
    return done.stdout


def _unpack(package: Path, folder: Path) -> str:
    """Writes vmlinuz and every module, flat, into folder; gives the kernel's release."""
    release = ""
    unpacking = subprocess.Popen(["dpkg", "--fsys-tarfile", str(package)], stdout=subprocess.PIPE)
    with unpacking as dpkg, tarfile.open(fileobj=dpkg.stdout, mode="r|") as files:
        for member in files:
            name = Path(member.name).name
            if name.startswith("vmlinuz-"):
                release = name.removeprefix("vmlinuz-")
                name = "vmlinuz"
            elif not name.endswith((".ko", ".ko.xz")) or any(part in member.name for part in FOLDERS_OF_NO_USE):
                continue
            data = files.extractfile(member).read()
            # Newer kernels have their modules compressed.
            (folder / name.removesuffix(".xz")).write_bytes(lzma.decompress(data) if name.endswith(".xz") else data)
    if not release:
        raise VmError(f"{package.name} holds no kernel")
    return release


def _keep_what_is_loaded(folder: Path) -> None:
    modules = {path.stem.replace("-", "_"): path for path in folder.glob("*.ko")}
    needed: set[Path] = set()
    for name in (*TO_BOOT, *TO_TEST):
        order = _load_order(name.replace("-", "_"), modules)
        (folder / f"{name}.load").write_text("".join(f"{path.name}\n" for path in order))
        needed.update(order)
    for path in modules.values():
        if path not in needed:
            path.unlink()


def _load_order(name: str, modules: dict[str, Path]) -> list[Path]:
    """The module of that name after all that it needs, which its own .modinfo section says."""
    if name not in modules:
        raise VmError(f"the kernel's package has no module {name}")
    depends = re.search(rb"\0depends=([^\0]*)\0", modules[name].read_bytes())
    order: list[Path] = []
    for other in depends[1].decode().split(",") if depends and depends[1] else []:
        order += [path for path in _load_order(other.replace("-", "_"), modules) if path not in order]
    return [*order, modules[name]]
