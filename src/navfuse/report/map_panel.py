"""The map: tracks, stretches without GNSS, and the fixes by type and fate, in metres east and north of the start."""

from __future__ import annotations

import numpy as np

from navfuse.data.logs import GnssLog
from navfuse.report.curves import CLOUD_POINTS, Curve, Panel, Scene, over_time, solutions_of
from navfuse.report.packing import Steps
from navfuse.report.series import POSITION_SOURCE, Origin, decimate, east_north, fix_status, gaps, origin_of, thin
from navfuse.report.text import label

Array = np.ndarray

MAP_POINTS = 4000
PLACE_STEP = 1e-3
KNOWN_TYPES = ("rtk-fixed", "rtk-float", "ppp", "dgps", "sbas", "single")
OTHER_TYPES = 3
FATES = {
    "reset": "used after a reset",
    "rejected": "rejected",
    "withheld": "withheld",
    "late": "too late",
    "unused": "not used",
}


def map_panel(scene: Scene) -> Panel:
    """Curves with east in `e` and north in `y`, and the view [west, east, south, north] that shows what matters."""
    result = scene.result
    origin = origin_of(result.forward)
    tracks, planes = [], []
    for role, trajectory in solutions_of(result, scene.truth).items():
        plane = east_north(trajectory, origin)
        rows = decimate(plane, MAP_POINTS)
        tracks.append(_placed(scene.names[role], role, "line", trajectory.time[rows] - scene.start, plane[rows]))
        planes.append(plane)
    clouds: list[Curve] = []
    numbers = []
    if result.fixes is not None and result.fixes.time.size:
        plane = east_north(result.fixes, origin)
        status = fix_status(result)
        assert status is not None
        clouds = _clouds(scene, plane, status)
        known = plane[np.isfinite(plane).all(axis=1)]
        used = plane[np.isin(status, ("used", "reset"))]
        planes.append(used[np.isfinite(used).all(axis=1)])
        if known.size:
            planes.append(np.percentile(known, (5.0, 95.0), axis=0))
        view = _view(planes)
        outside = np.count_nonzero(
            (plane[:, 0] < view[0]) | (plane[:, 0] > view[1]) | (plane[:, 1] < view[2]) | (plane[:, 1] > view[3])
        )
        if outside:
            numbers.append(f"{outside} fixes lie outside the first view")
    view = _view(planes)
    outages = _outages(scene, origin)
    size = f"{view[1] - view[0]:.0f} m by {view[3] - view[2]:.0f} m shown"
    return {
        "tracks": [*outages, *tracks],
        "clouds": clouds,
        "view": view,
        "numbers": "; ".join([size, *numbers]),
        "note": _note(scene),
    }


def fix_groups(fixes: GnssLog) -> list[tuple[str, str, Array]]:
    """Name, colour role and rows of every fix type: the known ones, the most frequent others, and the rest as one."""
    count = fixes.time.size
    if fixes.fix is None:
        return [("fixes", "used", np.arange(count))]
    names, which = np.unique(fixes.fix.astype(str), return_inverse=True)
    sizes = np.bincount(which, minlength=names.size)
    found, others = [], []
    for k in np.argsort(-sizes, kind="stable").tolist():
        kind = str(names[k])
        if kind.lower() in KNOWN_TYPES:
            found.append((kind, f"fix-{kind.lower()}", np.flatnonzero(which == k)))
        else:
            others.append(k)
    for j, k in enumerate(others[:OTHER_TYPES]):
        found.append((str(names[k]) or "no type", f"fix-other{j + 1}", np.flatnonzero(which == k)))
    if len(others) > OTHER_TYPES:
        rest = np.isin(which, others[OTHER_TYPES:])
        found.append((f"{len(others) - OTHER_TYPES} other types", "unused", np.flatnonzero(rest)))
    return found


def _clouds(scene: Scene, plane: Array, status: Array) -> list[Curve]:
    fixes = scene.result.fixes
    assert fixes is not None
    groups = []
    for name, role, rows in fix_groups(fixes):
        used = int(np.count_nonzero(np.isin(status[rows], ("used", "reset"))))
        number = str(rows.size) if used == rows.size else f"{used} used of {rows.size}"
        groups.append((f"{label(name)} ({number})", role, rows))
    for fate, words in FATES.items():
        rows = np.flatnonzero(status == fate)
        groups.append((f"{words} ({rows.size})", fate, rows))
    clouds = []
    for name, role, rows in groups:
        rows = rows[np.isfinite(plane[rows]).all(axis=1)]
        if rows.size:
            rows = rows[thin(rows.size, CLOUD_POINTS)]
            time = fixes.time[rows] - scene.start
            clouds.append(_placed(name, role, "points", time, plane[rows]))
    return clouds


def _placed(name: str, role: str, kind: str, time: Array, plane: Array) -> Curve:
    return over_time(name, role, kind, time, Steps(plane[:, 1], PLACE_STEP), e=Steps(plane[:, 0], PLACE_STEP))


def _outages(scene: Scene, origin: Origin) -> list[Curve]:
    """The best track where no GNSS position was used, with breaks between."""
    records = scene.result.innovations
    if scene.bare or POSITION_SOURCE not in records.sources:
        return []
    best = scene.result.trajectory
    pieces = []
    for window in sorted(gaps(scene.result)):
        inside = np.flatnonzero((best.time >= window.start) & (best.time <= window.end))
        if inside.size > 1:
            pieces.append(inside[thin(inside.size, 200)])
    if not pieces:
        return []
    budget = max(MAP_POINTS // len(pieces), 2)
    pieces = [piece[thin(piece.size, budget)] for piece in pieces]
    rows = np.concatenate(pieces)
    plane = east_north(best.take(rows), origin)
    breaks = np.cumsum([piece.size for piece in pieces])[:-1]
    plane = np.insert(plane, breaks, np.nan, axis=0)
    time = np.insert(best.time[rows] - scene.start, breaks, best.time[rows[breaks]] - scene.start)
    return [_placed("no GNSS used", "outage", "line", time, plane)]


def _view(planes: list[Array]) -> list[float]:
    """Box around all rows, 4 % wider on each side and at least a metre wide."""
    finite = [plane[np.isfinite(plane).all(axis=1)] for plane in planes]
    rows = np.concatenate([plane for plane in finite if plane.size] or [np.zeros((1, 2))])
    low, high = rows.min(axis=0), rows.max(axis=0)
    pad = np.maximum(0.04 * (high - low), np.maximum(0.5 - 0.5 * (high - low), 0.0))
    west, south = (low - pad).tolist()
    east, north = (high + pad).tolist()
    return [west, east, south, north]


def _note(scene: Scene) -> str:
    fixes = scene.result.fixes
    if scene.bare:
        return "A trajectory alone: no GNSS fixes."
    if fixes is None or not fixes.time.size:
        return "No GNSS fixes in this run."
    if fixes.fix is None:
        return "Fix types are not in the log (column fix), so all fixes have one colour."
    return "Fixes coloured by the type that the log gives; marks over them tell what became of them."
