"""The parts of the page that are read off the run folder: what was run, by which parameters, and where the data are."""

import html
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

from ..errors import ConfigError
from ..run_record import NAME as RUN_TOML
from ..run_record import RunRecord
from ..tomlfile import CONFIG_TOML, read_table
from .tables import config_table

WHAT_IT_IS = {
    "map.sgrid": "the map: stereogrid view, export, score",
    "metrics.json": "all the numbers",
    CONFIG_TOML: "every parameter",
    RUN_TOML: "what was run, to run it again",
    "trajectory.tum": "where the camera was taken to be: stamp x y z qx qy qz qw",
    "results.md": "the tables as Markdown",
}
BY_SUFFIX = {
    ".tum": "where the camera was taken to be: stamp x y z qx qy qz qw",
    ".sgrid": "a map",
    ".mcap": "the recording",
    ".toml": "parameters",
    ".csv": "a table",
    ".parquet": "a table",
}


def read_config(folder: Path) -> Mapping[str, Any]:
    """The parameters in config.toml; nothing where there is none."""
    path = folder / CONFIG_TOML
    try:
        return read_table(path) if path.is_file() else {}
    except ConfigError:
        return {}


def record_facts(folder: Path) -> dict[str, str]:
    """What run.toml says of the run, where it stands in the folder."""
    if not (folder / RUN_TOML).is_file():
        return {}
    record = RunRecord.load(folder)
    part = [f"from {record.start_s:g} s"] if record.start_s else []
    part += [] if record.end_s is None else [f"to {record.end_s:g} s"]
    part += [f"one observation of {record.stride}"] if record.stride > 1 else []
    facts = {
        "program": record.program,
        "command": record.command,
        "recording": record.recording,
        "poses": record.poses if record.recording else "",
        "part of it": " ".join(part),
    }
    return {name: text for name, text in facts.items() if text}


def facts_html(facts: Mapping[str, str]) -> str:
    """What was run, as a table."""
    rows = "".join(f"<tr><th>{html.escape(k)}</th><td>{html.escape(v)}</td></tr>" for k, v in facts.items())
    return f'<h2>What was run</h2><div class="wide"><table class="facts"><tbody>{rows}</tbody></table></div>'


def config_html(folder: Path, table: Mapping[str, Any], config: object = None) -> str:
    """The parameters as a table, with their units where config is given, and as the file has them; else nothing."""
    path = folder / CONFIG_TOML
    if not path.is_file():
        return ""
    text = f"<pre>{html.escape(path.read_text(encoding='utf-8'))}</pre>"
    every = folded("Every parameter", config_table(table, config).html) if table else ""
    return f"<h2>Parameters</h2>{every}{folded(CONFIG_TOML, text)}"


def data_html(folder: Path) -> str:
    """Links to the files of the run, which lie beside the page."""
    files = [each for each in sorted(folder.iterdir()) if each.is_file() and each.suffix not in (".png", ".html")]
    files = [each for each in files if not each.name.startswith(".")]
    if not files:
        return ""
    rows = "".join(
        f'<tr><td><a href="{quote("./" + each.name)}">{html.escape(each.name)}</a></td>'
        f'<td class="number">{_size(each.stat().st_size)}</td><td>{html.escape(_what(each))}</td></tr>'
        for each in files
    )
    return f'<h2>The data</h2><div class="wide"><table><tbody>{rows}</tbody></table></div>'


def folded(summary: str, content: str) -> str:
    """Content that a reader unfolds; on paper it is unfolded."""
    return f"<details><summary>{html.escape(summary)}</summary>{content}</details>"


def _what(path: Path) -> str:
    return WHAT_IT_IS.get(path.name) or BY_SUFFIX.get(path.suffix, "")


def _size(n_bytes: int) -> str:
    if n_bytes < 1000:
        return f"{n_bytes} B"
    return f"{n_bytes / 1e3:.0f} kB" if n_bytes < 1e6 else f"{n_bytes / 1e6:.1f} MB"
