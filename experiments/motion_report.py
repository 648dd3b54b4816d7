"""What the experiment on the motion error leaves in its run folder."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from stereogrid.config import save_config
from stereogrid.figures import motion_figure, save_figure
from stereogrid.files import written_beside
from stereogrid.motion import MotionError, MotionFit, Runs, write_runs
from stereogrid.motion.parameters import UNITS, Parameter, parameters
from stereogrid.report import ReportFigure, ReportTable, write_metrics, write_report

from .motion_figures import recovery_figure, surfaces_figure
from .tidy import write_rows

SUMMARY = (
    "Straight lines of 5 m with a mark each metre and turns on the spot with a mark each quarter, half of them each "
    "way, on each surface; odometry beside the truth. First with errors that have causes, drawn run by run: radii, "
    "track, slip, encoders and heading, by the simulator's presets of wheel faults; over bumps each run finds others, "
    "and its physics err too. Then with errors of known growth, "
    "to see whether the fit finds it again."
)
GROWING = ("a", "b")


@dataclass(frozen=True)
class Caused:
    """The fit to the runs of a robot with a preset of faults on a surface."""

    surface: str
    faults: str
    runs: Runs
    fit: MotionFit


@dataclass(frozen=True)
class Recovered:
    """The fits, by bootstrap, to one set of runs of known error on a surface."""

    surface: str
    fits: Mapping[str, MotionFit]


def write_results(
    folder: Path,
    caused: Sequence[Caused],
    recovered: Sequence[Recovered],
    injected: MotionError,
    *,
    facts: Mapping[str, str],
    config: object = None,
) -> list[ReportTable]:
    """Runs and fits as CSV and TOML, figures, tables.md and the report; the tables for the screen."""
    tables = [*(caused_table(caused, name) for name in faults_of(caused)), recovery_table(recovered, injected)]
    narrow = [caused_table(caused, name, bounds=False) for name in faults_of(caused)]
    write_runs_and_fits(folder, caused)
    rows = [
        {"surface": each.surface, "set": n, "bootstrap": name, "injected": truth(injected, p), **asdict(p)}
        for n, each in enumerate(recovered)
        for name, fit in each.fits.items()
        for p in parameters(fit)
    ]
    write_rows(folder / "recovery.csv", rows, digits=6)
    write_metrics(folder, {"facts": facts, "tables": [asdict(table) for table in tables]})
    write_report(
        folder,
        "The motion error from repeated runs",
        summary=SUMMARY,
        arms={},
        figures=draw(folder, caused, recovered, injected),
        facts=facts,
        tables=tables,
        config=config,
    )
    with written_beside(folder / "tables.md") as temporary:
        temporary.write_text("\n\n".join(table.markdown for table in tables), encoding="utf-8")
    return [*narrow, tables[-1]]


def write_runs_and_fits(folder: Path, caused: Sequence[Caused]) -> None:
    """runs-<faults>.csv with all the surfaces, motion-<faults>-<surface>.toml, and caused.csv with every number."""
    for name in faults_of(caused):
        runs = tuple(run for each in caused if each.faults == name for run in each.runs)
        write_runs(folder / f"runs-{name}.csv", Runs(runs))
    for each in caused:
        save_config(each.fit.error, folder / f"motion-{each.faults}-{each.surface.replace(', ', '-')}.toml")
    rows = [{"surface": c.surface, "faults": c.faults, **asdict(p)} for c in caused for p in parameters(c.fit)]
    write_rows(folder / "caused.csv", rows, digits=6)


def draw(
    folder: Path, caused: Sequence[Caused], recovered: Sequence[Recovered], injected: MotionError
) -> list[ReportFigure]:
    """Runs of each preset on the last ground, which is bumpy where any is, the surfaces, and the recovery."""
    figures = []
    for name in faults_of(caused):
        last = [each for each in caused if each.faults == name][-1]
        path = save_figure(motion_figure(last.runs, last.fit), folder / f"runs-{name}.png")
        figures.append(ReportFigure(path, f"Runs on {last.surface} by a robot with faults {name!r}, and the fit."))
    if caused:
        path = save_figure(surfaces_figure([(c.surface, c.faults, c.fit) for c in caused]), folder / "surfaces.png")
        figures.append(
            ReportFigure(path, "Sigma after the length of a run, with its 95 % interval, and the bias then.")
        )
    found = [[(p, truth(injected, p)) for p in of_growth(each.fits["drawn"])] for each in recovered]
    path = save_figure(recovery_figure(found), folder / "recovery.png")
    caption = "Every set: estimate and 95 % interval over what was injected; in red where the interval misses it."
    return [*figures, ReportFigure(path, caption)]


def faults_of(caused: Iterable[Caused]) -> list[str]:
    """The presets in their order."""
    return list(dict.fromkeys(each.faults for each in caused))


def of_growth(fit: MotionFit) -> list[Parameter]:
    """The parameters a and b of each part."""
    return [each for each in parameters(fit) if each.name in GROWING]


def truth(injected: MotionError, parameter: Parameter) -> float:
    """What a parameter should be: the noise has no bias."""
    growth = getattr(injected, parameter.part)
    if parameter.name in GROWING:
        return float(getattr(growth, parameter.name))
    return 0.0 if parameter.name == "bias" else float("nan")


def caused_table(caused: Sequence[Caused], faults: str, *, bounds: bool = True) -> ReportTable:
    """A row a surface: sigma after a run's length, with its interval where bounds, and the bias then, of each part."""
    rows = []
    for each in caused:
        if each.faults == faults:
            cells = []
            for part in UNITS:
                found, (times, digits) = each.fit.parts[part], SHOWN[part]
                sigma, low, high = (f"{times * each:.{digits}f}" for each in (found.sigma, *found.sigma_bounds))
                cells.append(f"{sigma} ({low} to {high})" if bounds else sigma)
                # No minus before what is rounded to nothing.
                cells.append(f"{round(times * found.bias * found.reached, digits) + 0.0:+.{digits}f}")
            rows.append([each.surface, *cells])
    header = ["surface", *(name for part in UNITS for name in (f"{part} {IN[part]}", "bias"))]
    n = caused[0].fit.parts["along"].n
    note = f"Sigma and bias after 5 m, of turn after a full turn; {n} runs each; in brackets the 95 % interval."
    return ReportTable(
        f"Faults {faults!r}: sigma and bias after 5 m, of turns after a full one", header, rows, note=note
    )


SHOWN = {"along": (100.0, 2), "across": (100.0, 2), "heading": (np.degrees(1), 2), "turn": (np.degrees(1), 1)}
"""Times what a number is shown, and with how many decimals."""
IN = {"along": "[cm]", "across": "[cm]", "heading": "[deg]", "turn": "[deg]"}


def recovery_table(recovered: Sequence[Recovered], injected: MotionError) -> ReportTable:
    """A row a parameter: what was injected, what was found, and how often the intervals hold it."""
    rows = []
    names = list(recovered[0].fits)
    found = {name: [list(parameters(each.fits[name])) for each in recovered] for name in names}
    for k, first in enumerate(found[names[0]][0]):
        true = truth(injected, first)
        if np.isnan(true):
            continue
        values = np.array([each[k].value for each in found[names[0]]])
        middle = np.sqrt(np.mean(values**2)) if first.name == "b" else values.mean()
        low, high = np.quantile(values, [0.025, 0.975])
        shares = [np.mean([each[k].low <= true <= each[k].high for each in found[name]]) for name in names]
        rows.append(
            [f"{first.part} {first.name}", first.unit, f"{true:g}", f"{middle:.2g}", f"{low:.2g} to {high:.2g}"]
            + [f"{share:.2f}" for share in shares]
        )
    header = ["parameter", "unit", "injected", "mean", "95 % of them", *(f"{name}" for name in names)]
    chance = 1.96 * np.sqrt(0.95 * 0.05 / len(recovered))
    note = (
        f"{len(recovered)} sets of runs. The mean of b is that of its square. Held: the share of 95 % intervals that "
        f"hold what was injected, from runs drawn anew or resampled; by chance .95 +- {chance:.2f}."
    )
    return ReportTable("Known errors found again", header, rows, n_names=2, note=note)
