"""Panels of the measurements: innovations in their gates, residuals, NIS, sigmas stated and realised, satellites."""

from __future__ import annotations

import numpy as np

from navfuse.data.result import Innovations, Result
from navfuse.report.curves import (
    AXES,
    BAND_POINTS,
    CLOUD_POINTS,
    CURVE_POINTS,
    UNITS,
    Curve,
    Panel,
    Row,
    Scene,
    band,
    band_between,
    curve,
    digits,
    over_time,
    panel,
    rms,
    row,
)
from navfuse.report.map_panel import fix_groups
from navfuse.report.quality import (
    STATED,
    TAKEN,
    gate_limits,
    gnss_sigmas,
    normalised,
    residual_histogram,
    running_nis,
)
from navfuse.report.series import decimate, thin
from navfuse.report.text import label

Array = np.ndarray

SECTION = "Measurements"
MOST_SOURCES = 10
"""Sources with panels of their own; the table of consistency holds all."""
GATE_AGREES = 0.99
NIS_FLOOR = 0.01
"""Below it NIS points are not shown; they tell nothing."""
STATUS_NAMES = {
    "used": "used",
    "reset": "used after a reset",
    "rejected": "rejected",
    "withheld": "withheld",
    "late": "too late",
}
NONE_OFFERED = "no measurement was offered to the filter"


def measurement_panels(scene: Scene) -> list[Panel]:
    """Every panel of the section, in page order."""
    if scene.bare:
        why = "a trajectory alone holds no measurements; give the folder of a run"
        return [panel("Innovations, residuals and NIS", "", [], SECTION, why=why)]
    records = scene.result.innovations
    sources = {source: records.of(source) for source in records.sources[:MOST_SOURCES]}
    gates = {source: gate_of(scene.result, source, found) for source, found in sources.items()}
    found = [_innovations(scene, source, one, gates[source]) for source, one in sources.items()]
    if not found:
        found.append(panel("Innovations", "", [], SECTION, why=NONE_OFFERED))
    if len(records.sources) > MOST_SOURCES:
        why = f"{len(records.sources) - MOST_SOURCES} more sources are in the table above only"
        found.append(panel("Innovations of other sources", "", [], SECTION, why=why))
    found += [_histograms(sources), _nis(scene, sources, gates)]
    found += [_sigmas(scene, source) for source in STATED]
    return [*found, _satellites(scene)]


def gate_of(result: Result, source: str, records: Innovations) -> Array | None:
    """Limits of the gate at every record; None where what it did is not what the record says.

    A sensor of the user's own may have a gate of its own, which no file tells.
    """
    known = result.summary.get("settings", {}) if source in STATED else {}
    section = known.get("gnss", {}) if isinstance(known, dict) else {}
    probability = section.get("gate_probability") if isinstance(section, dict) else None
    if not (isinstance(probability, (int, float)) and 0.0 < probability <= 1.0):
        probability = None
    limits = gate_limits(records, probability)
    judged = np.isfinite(records.nis) & np.isin(records.status, ("used", "rejected", "reset"))
    passed = records.nis[judged] <= limits[judged] * (1.0 + 1e-9)
    agrees = passed == (records.status[judged] == "used")
    return limits if judged.any() and np.mean(agrees) >= GATE_AGREES and np.isfinite(limits).any() else None


def _innovations(scene: Scene, source: str, records: Innovations, gate: Array | None) -> Panel:
    size = int(records.dof.max(initial=0))
    unit, names = _components(source, min(size, records.z.shape[1]))
    order = np.argsort(records.time, kind="stable")
    records = records.select(order)
    rows, numbers = [], []
    for k, axis in enumerate(names):
        known = np.isfinite(records.z[:, k]) & np.isfinite(records.sd[:, k])
        formed = records.select(known)
        time, sd = formed.time - scene.start, formed.sd[:, k]
        chosen = decimate(sd, BAND_POINTS)
        curves = [band("±3σ", "guide", time[chosen], 3.0 * sd[chosen])]
        curves += _clouds(scene, formed, formed.z[:, k])
        if gate is not None:
            reach = np.sqrt(gate[order][known]) * sd
            chosen = decimate(reach, BAND_POINTS)
            edge = [(time[chosen], sign * reach[chosen]) for sign in (1.0, -1.0)]
            curves += [over_time("gate", "gate", "line", *one) for one in edge]
        rows.append(row(axis, unit, curves if len(formed) else [], zero=True))
        taken = np.isin(formed.status, TAKEN)
        if taken.any():
            z = formed.z[taken, k]
            numbers.append(f"{axis} mean {digits(float(z.mean()))}, RMS {digits(rms(z))} of {digits(rms(sd[taken]))}")
    note = "Measured minus predicted, with three standard deviations of it (shaded)"
    if gate is not None:
        note += " and the gate (dashed), where one component alone would be rejected; it widens with the scatter"
    else:
        note += "; what the gate of this sensor was is not in the record"
    note += ". Rejected ones may lie outside the picture: the NIS below shows all."
    text = f"Used ones, RMS of what was expected: {'; '.join(numbers)} {unit}." if numbers else "None was used."
    why = "every measurement of this source came too late"
    return panel(f"Innovations: {label(source)}", note, rows, SECTION, numbers=text, why=why)


def _components(source: str, size: int) -> tuple[str, tuple[str, ...]]:
    block = source.removeprefix("gnss_")
    if source in STATED:
        return UNITS[block][0], AXES[block][:size]
    return "sensor unit", tuple(f"component {k + 1}" for k in range(size))


def _clouds(scene: Scene, records: Innovations, values: Array) -> list[Curve]:
    curves = []
    for status, name in STATUS_NAMES.items():
        found = np.flatnonzero((records.status == status) & np.isfinite(values))
        if found.size:
            rows = found[decimate(values[found], CLOUD_POINTS)]
            curves.append(over_time(name, status, "points", records.time[rows] - scene.start, values[rows]))
    return curves


def _histograms(sources: dict[str, Innovations]) -> Panel:
    rows, numbers = [], []
    for source, records in sources.items():
        used = records.select(np.isin(records.status, TAKEN))
        ratios = normalised(used)
        size = min(int(used.dof.max(initial=0)), ratios.shape[1])
        total = residual_histogram(ratios)
        curves = []
        for k, axis in enumerate(_components(source, size)[1]):
            found = residual_histogram(ratios[:, k])
            if found.n:
                curves.append(curve(axis, f"axis{k + 1}", "steps", _centres(found.edges), found.density))
        if curves:
            x = np.linspace(total.edges[0], total.edges[-1], 121)
            normal = np.exp(-0.5 * x**2) / np.sqrt(2.0 * np.pi)
            curves.append(curve("standard normal", "guide", "line", x, normal))
            outside = f", {total.outside} beyond the picture" if total.outside else ""
            numbers.append(
                f"{label(source)}: mean {digits(total.mean)}, standard deviation {digits(total.sd)}, "
                f"{total.beyond_3:.2%} beyond ±3 of {total.n}{outside}."
            )
        rows.append(row(source, "1", curves))
    return panel(
        "Normalised residuals",
        "Innovations that were used over their standard deviations, as a density. Right ones follow the standard "
        "normal: mean 0, standard deviation 1, 0.27 % beyond ±3. Wider: the sigmas are too small; narrower: too large.",
        rows,
        SECTION,
        numbers=" ".join(numbers),
        why=NONE_OFFERED if not sources else "no measurement was used",
        x=("innovation over its standard deviation", "1", False),
    )


def _centres(edges: Array) -> Array:
    return 0.5 * (edges[1:] + edges[:-1])


def _nis(scene: Scene, sources: dict[str, Innovations], gates: dict[str, Array | None]) -> Panel:
    rows, numbers = [], []
    for source, records in sources.items():
        known = np.isfinite(records.nis) & (records.nis > 0.0) & (records.dof > 0)
        gate = gates[source]
        limits = None if gate is None else (gate / np.maximum(records.dof, 1))[known]
        formed = records.select(known)
        order = np.argsort(formed.time, kind="stable")
        formed = formed.select(order)
        if not len(formed):
            continue
        curves = _clouds(scene, formed, formed.nis / formed.dof)
        if limits is not None:
            limits = limits[order]
            chosen = decimate(limits, BAND_POINTS)
            curves.append(over_time("gate", "gate", "line", formed.time[chosen] - scene.start, limits[chosen]))
        running = running_nis(formed)
        if running.time.size:
            time = running.time - scene.start
            words = f"mean of {running.window}"
            chosen = decimate(np.column_stack((running.low, running.high)), BAND_POINTS)
            bounds = running.low[chosen], running.high[chosen]
            curves.append(band_between(f"99 % of {words}s", "smoothed", time[chosen], *bounds))
            chosen = decimate(running.mean, CURVE_POINTS)
            curves.append(over_time(words, "smoothed", "line", time[chosen], running.mean[chosen]))
            last = digits(running.mean[-1])
            numbers.append(f"{label(source)}: {running.inside:.0%} of the running means inside, the last {last}.")
        rows.append(row(source, "1", curves, log=True, floor=NIS_FLOOR))
    return panel(
        "Consistency (NIS)",
        "Normalised innovation squared per component, logarithmic; 1 on average when the model is right. The line is "
        "the running mean of those used, the shade the chi-square bounds of a mean of so many, if the innovations are "
        "white. Above them the filter is too sure of itself or of the sensor, below too modest.",
        rows,
        SECTION,
        numbers=" ".join(numbers),
        why=NONE_OFFERED if not sources else "no innovation was formed: every measurement came too late",
    )


def _sigmas(scene: Scene, source: str) -> Panel:
    block = source.removeprefix("gnss_")
    unit, axes = UNITS[block][0], AXES[block]
    found = gnss_sigmas(scene.result, source)
    rows, numbers = [], []
    if found is not None and found.time.size:
        time = found.time - scene.start
        for k, axis in enumerate(axes):
            rows.append(row(axis, unit, _sigma_curves(time, *(part[:, k] for part in found[1:5])), log=True))
            ratio = rms(found.realised[:, k]) / rms(found.stated[:, k])
            numbers.append(
                f"{axis} {digits(rms(found.realised[:, k]))} of {digits(rms(found.stated[:, k]))} ({ratio:.1f}×)"
            )
    return panel(
        f"GNSS {block} sigma, reported and realised",
        "What the fixes that were used state, and what their innovations show once the filter's own uncertainty is "
        f"taken off, in windows of {found.window if found else 0} fixes (shade: 99 %). Realised above reported: raise "
        "gnss.sd_scale or look for what else moves the innovations (time offset, lever arm). No point: the filter's "
        "own uncertainty explains all.",
        rows,
        SECTION,
        numbers=f"Realised of reported: {', '.join(numbers)} {unit}." if numbers else "",
        why=_why_no_sigmas(scene, source),
    )


def _sigma_curves(time: Array, stated: Array, realised: Array, low: Array, high: Array) -> list[Curve]:
    floor = 0.03 * stated
    chosen = thin(time.size, CURVE_POINTS)
    time, stated, floor, high = time[chosen], stated[chosen], floor[chosen], high[chosen]
    realised = np.where(realised[chosen] > 0.0, realised[chosen], np.nan)
    one = "points" if time.size == 1 else "line"
    curves = [
        over_time("reported", "guide", one, time, stated),
        over_time("realised", "used", one, time, realised, markers=True),
    ]
    if time.size > 1:
        curves.append(band_between("99 %", "used", time, np.maximum(low[chosen], floor), np.maximum(high, floor)))
    return curves


def _why_no_sigmas(scene: Scene, source: str) -> str:
    fixes, records = scene.result.fixes, scene.result.innovations.of(source)
    block = source.removeprefix("gnss_")
    if fixes is None:
        return "the run holds no GNSS fixes"
    if getattr(fixes, STATED[source]) is None:
        return f"no {block} in the GNSS log" if block == "velocity" else f"no {block} sigmas in the GNSS log"
    if not len(records):
        return f"the filter was offered no GNSS {block} (gnss.use)"
    used = np.count_nonzero(np.isin(records.status, TAKEN))
    return f"only {used} of {len(records)} were used: too few to tell a scatter"


def _satellites(scene: Scene) -> Panel:
    fixes = scene.result.fixes
    rows: list[Row] = []
    numbers, why = "", "the run holds no GNSS fixes"
    if fixes is not None:
        why = "the number of satellites is not in the GNSS log (column n_satellites)"
        if fixes.n_satellites is not None and fixes.time.size:
            count = np.asarray(fixes.n_satellites, dtype=float)
            curves = []
            for name, role, group in fix_groups(fixes):
                known = group[np.isfinite(count[group])]
                if known.size:
                    chosen = known[decimate(count[known], CLOUD_POINTS)]
                    curves.append(over_time(name, role, "points", fixes.time[chosen] - scene.start, count[chosen]))
            rows = [row("satellites", "count", curves)]
            if curves:
                known = count[np.isfinite(count)]
                numbers = f"{known.min():.0f} to {known.max():.0f}, median {np.median(known):.0f}."
    note = "Satellites that each fix used, coloured by fix type."
    return panel("Number of satellites", note, rows, SECTION, numbers=numbers, why=why)
