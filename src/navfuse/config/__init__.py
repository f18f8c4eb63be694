"""One validated model of the project file.

Keys carry their units in their names and stay in those units here; :meth:`Project.imu_error_model` is where the
sensor errors become SI. An unknown key is an error that names the nearest known one.
"""

from navfuse.config.dead_reckoning import DeadReckoningConfig, DeadReckoningProject, any_project
from navfuse.config.project import Project, load_project
from navfuse.config.reference import KeyHelp, help_keys, template
from navfuse.config.sections import (
    AidingConfig,
    FilterConfig,
    GnssConfig,
    ImuConfig,
    OutputConfig,
    SmootherConfig,
    StartConfig,
)

__all__ = [
    "AidingConfig",
    "DeadReckoningConfig",
    "DeadReckoningProject",
    "FilterConfig",
    "GnssConfig",
    "ImuConfig",
    "KeyHelp",
    "OutputConfig",
    "Project",
    "SmootherConfig",
    "StartConfig",
    "any_project",
    "help_keys",
    "load_project",
    "template",
]
