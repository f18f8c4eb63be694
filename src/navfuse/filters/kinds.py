"""The kinds of filter, by the names that a project file has for them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from navfuse.aiding.base import AidingSensor
from navfuse.data.start import Start
from navfuse.filters.ekf import ErrorStateFilter
from navfuse.filters.feedback import FeedbackFilter
from navfuse.filters.feedforward import feedforward_filter
from navfuse.filters.iterated import IteratedFilter
from navfuse.filters.navigation_filter import NavigationFilter
from navfuse.filters.settings import FilterSettings
from navfuse.filters.unscented import UnscentedFilter, cubature_filter
from navfuse.imu.error_model import ImuErrorModel

FILTERS: dict[str, Callable[[Start, ImuErrorModel, Sequence[AidingSensor], FilterSettings], NavigationFilter]] = {
    "ekf": ErrorStateFilter,
    "ukf": UnscentedFilter,
    "ckf": cubature_filter,
    "iekf": IteratedFilter,
    "ukf-feedback-12": FeedbackFilter,
    "ukf-feedforward-15": feedforward_filter,
}
"""What each estimator is built by."""
