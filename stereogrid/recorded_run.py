"""Run folders that tell what made them: config.toml and run.toml are there from the start, the results' hashes last."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path

from .digests import digest_of, results_of
from .report import SEEDS, environment
from .run_record import RunRecord
from .runs import run_folder
from .tomlfile import CONFIG_TOML, save_config


@contextmanager
def recorded_run(root: Path, name: str, record: RunRecord, config: object = None) -> Iterator[Path]:
    """runs.run_folder with config.toml and run.toml in it: the record, with inputs' digests, versions, machine, time.

    config: every parameter of the run, where it has any. Raises RecordingError when something that is to be read is
    not there.
    """
    record = record.with_digests()
    with run_folder(root, name) as folder:
        if config is not None:
            save_config(config, folder / CONFIG_TOML)
            record = replace(record, seed=_seed(config), config_sha256=digest_of(folder / CONFIG_TOML))
        about = environment()
        machine = about.pop("machine")
        record = replace(record, machine=machine, versions={**_versions(about.pop("versions")), **about})
        record.save(folder)
        yield folder
        took_s = (datetime.now(timezone.utc) - record.started).total_seconds()
        replace(record, duration_s=max(round(took_s, 1), 0.1), results=results_of(folder)).save(folder)


def _seed(config: object) -> int | None:
    found = (getattr(config, name, None) for name in SEEDS)
    return next((seed for seed in found if isinstance(seed, int)), None)


def _versions(text: str) -> dict[str, str]:
    """environment()'s "numpy 2.1, numba 0.60" by name."""
    return dict(each.rsplit(" ", 1) for each in text.split(", "))
