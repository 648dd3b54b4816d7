"""The tables of the correlation experiment."""

from collections.abc import Mapping

from stereogrid.report import ReportTable

from .correlation import WINDOWS_PX, Measured


def correlation_tables(found: Mapping[str, Measured]) -> list[ReportTable]:
    """L a scene, a column a matcher; and what is kept of each matcher."""
    scenes = list(dict.fromkeys(row.scenes for each in found.values() for row in each.rows))
    length = {(row.matcher, row.scenes): row for each in found.values() for row in each.rows}
    lines = [[scene, *(f"{length[name, scene].correlation_px:.1f}" for name in found)] for scene in scenes]
    for kind in ("real", "simulated"):
        lines += [[f"mean, {kind}", *(f"{each.mean(real=kind == 'real'):.1f}" for each in found.values())]]
    for side in WINDOWS_PX:
        number = f"looks_{side}"
        lines += [[f"looks in {side} x {side} px, real", *(f"{e.mean(number, real=True):.1f}" for e in found.values())]]
    by_scene = ReportTable("L [px]", ["scenes", *found], lines, note="Means are geometric, over groups of scenes.")
    header = ["matcher", "temporal share", "simulated", "decorrelation px", "lasting", "apart by px", "by m"]
    over_time = []
    for name, each in found.items():
        apart = each.motion.collapse()
        reach = each.reach
        numbers = (reach.temporal_share, 1 - each.motion.at_rest, reach.decorrelation_px, reach.lasting_share)
        over_time.append([name, *(f"{value:.2f}" for value in (*numbers, apart["px"], apart["m"]))])
    return [by_scene, ReportTable("From one observation to the next", header, over_time)]
