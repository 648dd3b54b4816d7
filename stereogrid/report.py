"""report.html: one self-contained file for a run, made from the files that stand in its folder."""

import base64
import html
import json
import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from .errors import InvalidInputError
from .files import written_beside
from .scoring import BOUND_NAMES, SCORE_NAMES, Score
from .scoring.score import DIMENSIONLESS

STYLE = """
:root { color-scheme: light dark; --line: #8886; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }
table { border-collapse: collapse; margin: 1rem 0; } caption { text-align: left; font-weight: 600; }
th, td { text-align: left; padding: .25rem .9rem .25rem 0; border-bottom: 1px solid var(--line); vertical-align: top; }
td.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
figure { margin: 1.5rem 0; break-inside: avoid; } figure img { max-width: 100%; background: white; }
figcaption { font-size: .9rem; } pre { overflow-x: auto; padding: .8rem; border: 1px solid var(--line); }
@media print { body { margin: 0; max-width: none; font-size: 11pt; } details > * { display: block; } }
"""


@dataclass(frozen=True)
class ReportFigure:
    """A picture (PNG file in the run folder) and what it shows."""

    path: Path
    caption: str


@dataclass(frozen=True)
class ReportTable:
    """Rows of text under a header; the first n_names columns name the row, the others hold numbers.

    caption: what is shown, in few words; note: how to read it.
    """

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    n_names: int = 1
    note: str = ""

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.header):
                raise InvalidInputError(f"a row of {len(row)} cells under a header of {len(self.header)}: {row[0]}")

    @property
    def html(self) -> str:
        """The table as HTML."""
        head = "".join(f"<th>{html.escape(cell)}</th>" for cell in self.header)
        kinds = ["<td>" if n < self.n_names else '<td class="number">' for n in range(len(self.header))]
        rows = (
            "".join(f"{kind}{html.escape(cell)}</td>" for kind, cell in zip(kinds, row, strict=True))
            for row in self.rows
        )
        body = "".join(f"<tr>{row}</tr>" for row in rows)
        note = f"<p>{html.escape(self.note)}</p>" if self.note else ""
        return f"<table><caption>{html.escape(self.caption)}</caption><tr>{head}</tr>{body}</table>{note}"

    @property
    def markdown(self) -> str:
        """The table as Markdown, under its caption and note."""
        lines = [self.header, ["---"] * len(self.header), *self.rows]
        table = "".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |\n" for line in lines)
        return f"{self.caption}. {self.note}".strip() + f"\n\n{table}"


def write_report(
    folder: Path,
    title: str,
    *,
    summary: str,
    arms: Mapping[str, Sequence[Score]],
    figures: Sequence[ReportFigure],
    facts: Mapping[str, str],
    headline: Sequence[str] = (),
    meanings: Mapping[str, str] | None = None,
    tables: Sequence[ReportTable] = (),
) -> Path:
    """Write folder/report.html with the figures inside it.

    arms: scores of each arm of the experiment, by the arm's name; those named in headline come first, or the tables
    instead, where there are any; all scores come after the figures. meanings: of scores that neither SCORE_NAMES nor
    BOUND_NAMES holds. facts: what was run (command, seed, ...); versions and the machine are added. config.toml is
    quoted where it stands in the folder.
    """
    first = {
        arm: sorted((score for score in scores if score.name in headline), key=lambda score: headline.index(score.name))
        for arm, scores in arms.items()
    }
    config = folder / "config.toml"
    parts = [
        f"<h1>{html.escape(title)}</h1><p>{html.escape(summary)}</p>",
        *(table.html for table in tables),
        "" if tables else score_table(first if headline else arms, meanings),
        *(_figure(figure) for figure in figures),
        _folded("All scores", score_table(arms, meanings)) if arms and (headline or tables) else "",
        _facts({**facts, **environment()}),
    ]
    if config.exists():
        text = html.escape(config.read_text(encoding="utf-8"))
        parts.append(_folded("config.toml", f"<pre>{text}</pre>"))
    body = "\n".join(parts)
    page = (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        f'<meta name="viewport" content="width=device-width"><title>{html.escape(title)}</title>'
        f"<style>{STYLE}</style></head><body>{body}</body></html>"
    )
    path = folder / "report.html"
    with written_beside(path) as temporary:
        temporary.write_text(page, encoding="utf-8")
    return path


def score_table(arms: Mapping[str, Sequence[Score]], meanings: Mapping[str, str] | None = None) -> str:
    """The scores as an HTML table: a row a score, a column an arm, the unit and the meaning beside them."""
    known = {name: meaning for name, (_, meaning) in (SCORE_NAMES | BOUND_NAMES).items()} | dict(meanings or {})
    names = list(dict.fromkeys(score.name for scores in arms.values() for score in scores))
    by_arm = {arm: {score.name: score for score in scores} for arm, scores in arms.items()}
    head = "".join(f"<th>{html.escape(arm)}</th>" for arm in arms)
    rows = []
    for name in names:
        cells = "".join(f'<td class="number">{format_score(row.get(name))}</td>' for row in by_arm.values())
        meaning = html.escape(known.get(name, ""))
        rows.append(f"<tr><td>{html.escape(name)}</td>{cells}<td>{meaning}</td></tr>")
    return f"<table><tr><th>score</th>{head}<th>meaning</th></tr>{''.join(rows)}</table>"


def format_score(score: Score | None) -> str:
    """The value with its unit; a dash where there is no number."""
    if score is None:
        return "-"
    return html.escape(score.text + ("" if score.unit == DIMENSIONLESS else f" {score.unit}"))


def environment() -> dict[str, str]:
    """Versions of what the numbers depend on, and the kind of machine."""
    packages = ("stereogrid", "numpy", "numba", "opencv-python-headless", "trimesh", "embreex", "pybullet")
    versions = {name: _version(name) for name in packages}
    return {
        "versions": ", ".join(f"{name} {version}" for name, version in versions.items() if version),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores",
    }


def write_metrics(folder: Path, metrics: Mapping[str, object]) -> Path:
    """Write folder/metrics.json; NaN must already be null (scores_to_dict sees to that)."""
    path = folder / "metrics.json"
    with written_beside(path) as temporary:
        temporary.write_text(json.dumps(metrics, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return path


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""


def _folded(summary: str, content: str) -> str:
    return f"<details><summary>{html.escape(summary)}</summary>{content}</details>"


def _figure(figure: ReportFigure) -> str:
    picture = base64.b64encode(figure.path.read_bytes()).decode()
    caption = html.escape(figure.caption)
    image = f'<img alt="{caption}" src="data:image/png;base64,{picture}">'
    return f"<figure>{image}<figcaption>{caption}</figcaption></figure>"


def _facts(facts: Mapping[str, str]) -> str:
    rows = "".join(f"<tr><th>{html.escape(k)}</th><td>{html.escape(v)}</td></tr>" for k, v in facts.items())
    return f"<table><caption>What was run</caption>{rows}</table>"
