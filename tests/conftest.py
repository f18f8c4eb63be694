"""What every test may rely on: one thread, no deadlines, the shared data; no unexpected skip on the build server."""

from __future__ import annotations

import os
from pathlib import Path

import hypothesis
import pytest

for _variable in ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")
os.environ.setdefault("MPLBACKEND", "agg")

DATA = Path(__file__).resolve().parents[1].parent / "shared" / "data"

hypothesis.settings.register_profile(
    "navfuse",
    deadline=None,
    derandomize=bool(os.environ.get("CI")),
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.load_profile("navfuse")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the logs that are too large or not ours to keep in the project."""
    if not DATA.is_dir():
        pytest.skip("the shared data are not beside the project")
    return DATA


def _unexpected_skips(config: pytest.Config) -> list[str]:
    """Skips on the build server, where everything a test needs is there; none elsewhere."""
    if not os.environ.get("CI") or not DATA.is_dir():
        return []
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    return [report.nodeid for report in reporter.stats.get("skipped", [])] if reporter else []


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    if session.exitstatus == pytest.ExitCode.OK and _unexpected_skips(session.config):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    for nodeid in _unexpected_skips(config):
        terminalreporter.write_line(f"SKIPPED ON THE BUILD SERVER, which counts as a failure: {nodeid}")


@pytest.fixture
def estimators_in_order():
    """Puts back what a test does to the table of estimators, in their order, in which messages list them."""
    from navfuse.filters.kinds import FILTERS

    before = dict(FILTERS)
    yield
    FILTERS.clear()
    FILTERS.update(before)
