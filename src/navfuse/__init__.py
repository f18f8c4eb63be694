"""navfuse: from sensor logs to a trajectory one can trust.

``navfuse.process("project.toml")`` runs a whole project; ``navfuse.pipeline`` is where to start reading.

Conventions, everywhere in this package:

**Frames.** ``i`` inertial; ``e`` Earth-centred Earth-fixed (ECEF, WGS 84); ``n`` local north-east-down; ``b`` body
forward-right-down, at the IMU; ``a`` the antenna. ``C_nb`` takes components from b to n, so touching letters cancel:
``C_en @ C_nb @ l_b``. The last letter of a vector is the frame it is resolved in: ``v_n``, ``f_b``, ``r_e``;
``w_ib_b`` is the rate of b against i, resolved in b. Quaternions ``q_nb`` are Hamilton, scalar first.

**Units.** SI and radians inside. Every file column, configuration key, option and plotted axis names its unit:
``lat_deg``, ``arw_deg_per_sqrt_h``. Conversions happen at the edges (``io``, ``config``, ``report``) only.

**Attitude.** Roll (right side down), pitch (nose up), heading (0 = true north, clockwise, 0..360 deg), applied in the
order heading, pitch, roll. A level sensor at rest measures ``f_b = (0, 0, -g)``.

**Position.** Geodetic latitude, longitude, height above the WGS 84 ellipsoid; "down" is along its inward normal.

**Signs of errors.** ``delta = true - estimate`` for every additive state. The attitude error is the small rotation,
resolved in n (or e), that takes the estimated attitude to the true one: ``C_true = exp([psi x]) C_estimate``.
Innovations are measured minus predicted. In comparisons for people an error is solution minus truth.

**Time.** float64 seconds on one continuous scale, as the logs have it (GPS time for GNSS logs); never UTC. IMU
increments cover the half-open interval ``(t[k-1], t[k]]`` and carry the stamp of its end.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from navfuse import _numba_cache

_numba_cache.configure()

from navfuse.errors import (  # noqa: E402
    AlignmentError,
    ConfigError,
    FilterError,
    InputError,
    NavfuseError,
    NavfuseWarning,
    OutputError,
)

if TYPE_CHECKING:
    from navfuse import figures
    from navfuse.analysis.metrics import compare
    from navfuse.comparison import compare_filters
    from navfuse.config import Project, load_project
    from navfuse.data.logs import GnssLog, ImuLog
    from navfuse.data.result import Result
    from navfuse.data.trajectory import Trajectory
    from navfuse.export_files import export
    from navfuse.io.gnss_table import read_gnss
    from navfuse.io.imu_table import read_imu
    from navfuse.io.result_folder import read_result
    from navfuse.io.trajectory_table import read_trajectory
    from navfuse.pipeline import process
    from navfuse.report.figures_files import plot
    from navfuse.scenario_files import simulate_scenario

__version__ = "0.1.0"

_HOMES = {
    "GnssLog": "navfuse.data.logs",
    "ImuLog": "navfuse.data.logs",
    "Project": "navfuse.config",
    "Result": "navfuse.data.result",
    "Trajectory": "navfuse.data.trajectory",
    "compare": "navfuse.analysis.metrics",
    "compare_filters": "navfuse.comparison",
    "export": "navfuse.export_files",
    "load_project": "navfuse.config",
    "plot": "navfuse.report.figures_files",
    "process": "navfuse.pipeline",
    "read_gnss": "navfuse.io.gnss_table",
    "read_imu": "navfuse.io.imu_table",
    "read_result": "navfuse.io.result_folder",
    "read_trajectory": "navfuse.io.trajectory_table",
    "simulate_scenario": "navfuse.scenario_files",
}

_MODULES = ("figures",)

__all__ = [
    "AlignmentError",
    "ConfigError",
    "FilterError",
    "GnssLog",
    "ImuLog",
    "InputError",
    "NavfuseError",
    "NavfuseWarning",
    "OutputError",
    "Project",
    "Result",
    "Trajectory",
    "__version__",
    "compare",
    "compare_filters",
    "export",
    "figures",
    "load_project",
    "plot",
    "process",
    "read_gnss",
    "read_imu",
    "read_result",
    "read_trajectory",
    "simulate_scenario",
]


def __getattr__(name: str) -> Any:
    """Import the home of a public name when it is first asked for, which keeps ``import navfuse`` cheap."""
    if name not in _HOMES and name not in _MODULES:
        raise AttributeError(f"module 'navfuse' has no attribute {name!r}")
    from importlib import import_module

    value = import_module(f"navfuse.{name}") if name in _MODULES else getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
