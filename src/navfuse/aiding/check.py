"""Conformance tests for aiding sensors, for users' own before a filter relies on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from navfuse.aiding.base import AidingSensor, difference_steps, noise_covariance, numerical_jacobian
from navfuse.data.layout import NAVIGATION_STATES, Layout
from navfuse.data.nav_state import NavState
from navfuse.errors import ConfigError

Array = np.ndarray


@dataclass(frozen=True, slots=True)
class CheckReport:
    """What :func:`check` tried.

    Attributes
    ----------
    passed : tuple of str
        One line per test.
    """

    passed: tuple[str, ...]

    def __str__(self) -> str:
        return "\n".join(f"ok: {line}" for line in self.passed)


def check(sensor: AidingSensor, nav: NavState, rows: int = 5) -> CheckReport:
    """Try whether an aiding sensor does what filters and smoothers rely on.

    Parameters
    ----------
    sensor : AidingSensor
    nav : NavState
        A state with non-zero velocity, attitude and angular rate, so that wrong terms show. The sensor's own states
        need not be in its layout: they are appended.
    rows : int
        How many measurements to try, spread over the log.

    Returns
    -------
    CheckReport

    Raises
    ------
    ConfigError
        With one line for everything that is wrong, each saying what to do.
    """
    nav = _with_states(nav, sensor)
    wrong: list[str] = []
    passed: list[str] = []

    def test(good: bool, what: str, advice: str) -> bool:
        (passed if good else wrong).append(what if good else f"{what}: {advice}")
        return good

    test(bool(sensor.name) and isinstance(sensor.name, str), "has a name", "set `name` to a unique text")
    times = np.atleast_1d(np.asarray(sensor.times, dtype=float))
    good = times.ndim == 1 and times.size > 0 and bool(np.all(np.isfinite(times)))
    if test(good, "times are finite numbers", "set `times` to a one-dimensional array of seconds"):
        test(bool(np.all(np.diff(times) >= 0)), "times do not decrease", "sort the log by time")
        for k in np.unique(np.linspace(0, times.size - 1, min(rows, times.size)).astype(int)):
            _check_row(sensor, nav, int(k), test)
    if wrong:
        raise ConfigError(
            f"aiding sensor {sensor.name!r} does not conform:\n"
            + "\n".join(f"  {line}" for line in dict.fromkeys(wrong))
        )
    return CheckReport(tuple(dict.fromkeys(passed)))


def _check_row(sensor: AidingSensor, nav: NavState, k: int, test) -> None:
    before = (nav.array.copy(), nav.states.copy())
    value = np.atleast_1d(np.asarray(sensor.value(k), dtype=float))
    predicted = np.atleast_1d(np.asarray(sensor.predict(nav, k), dtype=float))
    unchanged = np.array_equal(before[0], nav.array) and np.array_equal(before[1], nav.states)
    test(unchanged, "predict leaves the navigation state alone", "copy arrays before changing them")
    if not test(
        value.shape == predicted.shape,
        "value and prediction have one shape",
        f"got {value.shape} and {predicted.shape}",
    ):
        return
    if not test(
        bool(np.all(np.isfinite(value))), "values are finite", f"measurement {k} is not; leave such rows out of `times`"
    ):
        return
    test(bool(np.all(np.isfinite(predicted))), "predictions are finite", f"that of measurement {k} is not")
    again = np.atleast_1d(np.asarray(sensor.predict(nav, k), dtype=float))
    test(
        np.array_equal(predicted, again), "predict gives the same twice", "it must not depend on anything but nav and k"
    )
    z = np.atleast_1d(np.asarray(sensor.subtract(value, value), dtype=float))
    test(bool(np.allclose(z, 0.0)), "subtract(value, value) is zero", "look at `subtract`")
    d = z.size
    try:
        R = noise_covariance(sensor.noise(k), d)
        positive = (
            R.shape == (d, d)
            and bool(np.all(np.isfinite(R)))
            and np.allclose(R, R.T)
            and bool(np.all(np.linalg.eigvalsh(R) > 0))
        )
    except (ValueError, np.linalg.LinAlgError):
        positive = False
    test(
        positive,
        "noise is a positive definite covariance",
        f"give `noise` as {d} positive standard deviations or a ({d}, {d}) covariance",
    )
    H = np.atleast_2d(np.asarray(sensor.jacobian(nav, k), dtype=float))
    if test(
        H.shape == (d, nav.layout.size), "jacobian has one row per component and one column per state", f"got {H.shape}"
    ):
        steps = difference_steps(nav.layout)
        numeric = numerical_jacobian(sensor, nav, k)
        scale = np.max(np.abs(numeric) * steps, axis=1, keepdims=True)
        apart = np.max(np.abs(H - numeric) * steps / np.where(scale > 0, scale, 1.0))
        test(
            bool(apart < 1e-3),
            "jacobian agrees with central differences of predict",
            f"they differ by {apart:.1e} of the largest effect",
        )
        _check_linearize(sensor, nav, k, H, test)


def _check_linearize(sensor: AidingSensor, nav: NavState, k: int, H: Array, test) -> None:
    z, H_fast, R = sensor.linearize(nav, k)
    plain = AidingSensor.linearize(sensor, nav, k)
    size = max(1e-9, float(np.max(np.abs(plain[0]))))
    good = (
        np.allclose(z, plain[0], rtol=1e-6, atol=1e-6 * size)
        and np.allclose(H_fast, H, atol=1e-9)
        and np.allclose(R, plain[2])
    )
    test(bool(good), "linearize agrees with value, predict, subtract, jacobian and noise", "mend or drop the override")


def _with_states(nav: NavState, sensor: AidingSensor) -> NavState:
    """The state with the sensor's own states in its layout."""
    missing = [block for block in sensor.state_blocks() if block.name not in nav.layout]
    if not missing:
        return nav
    layout = Layout((*nav.layout.blocks, *missing), nav.layout.imu_count)
    own = layout.per_state("value")[nav.layout.size - NAVIGATION_STATES :]
    return NavState(nav.time, nav.array, nav.ecef, np.concatenate([nav.states, own]), layout, nav.w_ib_b, nav.f_b)
