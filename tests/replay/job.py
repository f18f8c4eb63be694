"""A project in a folder of its own, to be spoilt and run as an operator would."""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pytest

from navfuse.analysis.metrics import compare
from navfuse.cli.app import main
from navfuse.config.toml_text import toml_value
from navfuse.io.trajectory_table import read_trajectory

if TYPE_CHECKING:
    import pandas as pd

    from navfuse.analysis.metrics import ErrorMetrics
    from navfuse.data.trajectory import Trajectory

Array = np.ndarray

EARLIER = "an earlier result\n"


class Outcome(NamedTuple):
    """What the person at the terminal gets: exit code, standard output, standard error."""

    code: int
    out: str
    err: str

    @property
    def warnings(self) -> list[str]:
        """Warnings, one line each."""
        return [line.removeprefix("warning: ") for line in self.err.splitlines() if line.startswith("warning: ")]


@dataclass
class Job:
    """Logs as tables, the project as a dictionary, and the folder both are written to."""

    folder: Path
    imu: pd.DataFrame
    gnss: pd.DataFrame
    truth: Trajectory | None = None
    project: dict[str, dict[str, Any]] = field(default_factory=dict)
    imu_name: str = "imu.parquet"
    gnss_name: str = "gnss.csv"

    @property
    def output(self) -> Path:
        """Where results go."""
        return self.folder / "out"

    def set(self, section: str, **keys: Any) -> Job:
        """Put keys into a section of the project; None takes one out."""
        table = self.project.setdefault(section, {})
        table.update(keys)
        self.project[section] = {name: value for name, value in table.items() if value is not None}
        return self

    def write(self) -> Path:
        """Write both logs and the project file."""
        for name, table in ((self.imu_name, self.imu), (self.gnss_name, self.gnss)):
            path = self.folder / name
            if path.suffix == ".parquet":
                table.to_parquet(path, index=False)
            else:
                table.to_csv(path, index=False)
        return self.write_project()

    def write_project(self) -> Path:
        """Write the project file alone."""
        lines = []
        for section, table in self.project.items():
            lines += [f"[{section}]", *(f"{name} = {toml_value(value)}" for name, value in table.items())]
        path = self.folder / "project.toml"
        path.write_text("\n".join(lines) + "\n")
        return path

    def run(self) -> Outcome:
        """Write everything, then ``navfuse run`` in this process."""
        return navfuse("run", self.write(), "-o", self.output, "--no-report")

    def refused(self, *words: str) -> str:
        """Run, and check how it is refused: exit code 1, one message with these words, no trace of a result.

        Returns
        -------
        str
            The message.
        """
        self.output.mkdir(exist_ok=True)
        (self.output / "forward.parquet").write_text(EARLIER)
        before = sorted(path.relative_to(self.folder) for path in self.folder.rglob("*"))
        code, out, err = self.run()
        assert code == 1, out + err
        lines = err.splitlines()
        errors = [k for k, line in enumerate(lines) if line.startswith("error: ")]
        assert len(errors) == 1, err
        assert all(line.startswith("warning: ") for line in lines[: errors[0]]), err
        assert out == ""
        message = "\n".join(lines[errors[0] :]).removeprefix("error: ")
        for word in words:
            assert word in message, f"{word!r} is not in: {message}"
        assert "Traceback" not in err
        assert (self.output / "forward.parquet").read_text() == EARLIER
        written = {path.relative_to(self.folder) for path in self.folder.rglob("*")} - set(before)
        assert {str(path) for path in written} <= {"project.toml", self.imu_name, self.gnss_name}
        return message

    def done(self, *words: str) -> Finished:
        """Run, and check that it ends well, with these words among its warnings.

        Every warning has to be in ``summary.json`` too.
        """
        outcome = self.run()
        assert outcome.code == 0, outcome.err
        finished = Finished(self, outcome, json.loads((self.output / "summary.json").read_text()))
        for word in words:
            assert any(word in warning for warning in outcome.warnings), f"{word!r} is not in: {outcome.err}"
        assert set(outcome.warnings) == set(finished.summary["warnings"])
        return finished


@dataclass(frozen=True)
class Finished:
    """A run that ended well."""

    job: Job
    outcome: Outcome
    summary: dict[str, Any]

    def trajectory(self, name: str = "forward") -> Trajectory:
        """A trajectory as written."""
        return read_trajectory(self.job.output / f"{name}.parquet")

    def measurements(self, source: str = "gnss_position") -> dict[str, Any]:
        """What the summary says of the measurements of a source."""
        return self.summary["measurements"][source]

    def counts(self, source: str = "gnss_position") -> dict[str, int]:
        """How many measurements of a source were used, rejected, ..."""
        return self.measurements(source)["counts"]

    def errors(self, name: str = "forward", **window: float) -> ErrorMetrics:
        """Errors against the truth of the job."""
        assert self.job.truth is not None
        return compare(self.trajectory(name), self.job.truth, **window)


def navfuse(*arguments: object) -> Outcome:
    """The program in this process, less what it says when its kernels are compiled first."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), pytest.raises(SystemExit) as ending:
        main([str(argument) for argument in arguments])
    told = [line for line in err.getvalue().splitlines() if not line.startswith("compiling the numerical kernels")]
    return Outcome(ending.value.code or 0, out.getvalue(), "".join(f"{line}\n" for line in told))


JobMaker = Callable[..., Job]
