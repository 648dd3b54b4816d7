"""Versions of installed packages."""

from importlib import metadata


def package_version(package: str) -> str:
    """Its version; "" where it is not installed."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""
