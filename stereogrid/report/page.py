"""The page itself: what a run was, its scores, its figures, its map to turn, and where the data are."""

import html
from collections.abc import Mapping, Sequence
from pathlib import Path

from ..files import written_beside
from ..scoring import Score
from .environment import environment, times
from .figures import ReportFigure, figure_html
from .parts import config_html, data_html, facts_html, folded, read_config, record_facts
from .tables import ReportTable, score_table, seeds
from .view3d import SCRIPT

STYLE = Path(__file__).with_name("style.css")
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
"""The browser itself sees to it that the page loads nothing from anywhere."""


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
    notes: Sequence[str] = (),
    config: object = None,
) -> Path:
    """Write folder/report.html with the figures inside it.

    arms: scores of each arm of the experiment, by the arm's name; those named in headline come first, or the tables
    instead, where there are any; all scores come after the figures. notes: how to read the scores, below them.
    meanings: of scores that scoring.meanings does not hold. facts: what was run (command, seed, ...); date, duration,
    versions and the machine are added, and what run.toml says, where it stands in the folder. config.toml is shown
    where there is one, with units where config is what it was written from. Files that stand in the folder by now are
    linked.
    """
    first = {
        arm: sorted((score for score in scores if score.name in headline), key=lambda score: headline.index(score.name))
        for arm, scores in arms.items()
    }
    table = read_config(folder)
    known = {**record_facts(folder), **times(folder), **facts}
    if seeds(table) and "seed" not in known:
        known["seed"] = seeds(table)
    said = "".join(f'<p class="quiet">{html.escape(note)}</p>' for note in notes)
    parts = [
        f"<h1>{html.escape(title)}</h1><p>{html.escape(summary)}</p>",
        *(table.html for table in tables),
        "" if tables or not arms else score_table(first if any(first.values()) else arms, meanings),
        said,
        *(figure_html(figure) for figure in figures),
        folded("All scores", score_table(arms, meanings)) if arms and (headline or tables) else "",
        facts_html({**known, **environment()}),
        config_html(folder, table, config),
        data_html(folder),
    ]
    path = folder / "report.html"
    with written_beside(path) as temporary:
        temporary.write_text(_page(title, parts, any(figure.scene for figure in figures)), encoding="utf-8")
    return path


def _page(title: str, parts: Sequence[str], alive: bool) -> str:
    script = f"<script>{SCRIPT.read_text(encoding='utf-8')}</script>" if alive else ""
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><title>{html.escape(title)}</title>'
        f"<style>{STYLE.read_text(encoding='utf-8')}</style></head><body>"
        + "\n".join(part for part in parts if part)
        + f"{script}</body></html>"
    )
