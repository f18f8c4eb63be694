from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from navfuse.analysis.plausibility import run_warnings, silence
from navfuse.data.logs import GnssLog
from navfuse.data.result import Innovations, Result, StateHistory
from navfuse.data.trajectory import Trajectory


def result(scatter=1.0, rejected=0, source="gnss_position", slip_deg=0.0, wander_deg=0.0, speed=10.0, n=400):
    """A run whose innovations are `scatter` times as large as claimed, and which moves `slip_deg` off its axis."""
    rng = np.random.default_rng(1)
    z = scatter * rng.standard_normal((n, 3))
    z[:rejected] = 50.0
    status = np.where(np.arange(n) < rejected, "rejected", "used")
    innovations = Innovations(
        time=np.arange(float(n)),
        source=np.full(n, source),
        status=status,
        nis=(z**2).sum(axis=1),
        dof=np.full(n, 3),
        z=z,
        sd=np.ones((n, 3)),
        row=np.arange(n),
    )
    heading = np.linspace(0.0, 20.0, n)
    course = heading + np.radians(slip_deg + wander_deg * rng.standard_normal(n))
    velocity = speed * np.column_stack([np.cos(course), np.sin(course), np.zeros(n)])
    attitude = np.column_stack([np.zeros((n, 2)), heading % (2.0 * np.pi)])
    forward = Trajectory(np.arange(float(n)), np.zeros(n), np.zeros(n), np.zeros(n), velocity, attitude)
    return Result(forward=forward, innovations=innovations)


def test_a_sound_run_is_quiet():
    assert run_warnings(result()) == []


@pytest.mark.parametrize("scatter", [0.2, 1.4])
def test_what_is_a_little_off_is_quiet(scatter):
    assert run_warnings(result(scatter)) == []


def test_innovations_larger_than_claimed():
    warning, refused = run_warnings(result(3.0, rejected=8))
    assert refused.startswith("fixes were offered and refused: 8 in a row from 0.0 s to 7.0 s")
    assert warning.startswith("innovations are larger than claimed: gnss_position 3.0 times (2.0 % rejected);")
    assert "imu.time_offset_s" in warning


def test_outliers_are_not_blamed_on_the_sigmas():
    warning, _ = run_warnings(result(rejected=40))
    assert warning.startswith("10.0 % of gnss_position rejected; what was used agrees with its standard deviations")


def with_outages(drift, windows):
    """A sound run, of which the fixes of some windows are withheld and off by one constant times `drift` each."""
    run = result()
    rng = np.random.default_rng(3)
    records = run.innovations
    z, status = records.z.copy(), records.status.astype("<U8")
    spans = [(20.0 + 30.0 * k, 35.0 + 30.0 * k) for k in range(windows)]
    for start, end in spans:
        inside = (records.time >= start) & (records.time < end)
        z[inside] = drift * rng.standard_normal(3)
        status[inside] = "withheld"
    innovations = replace(records, z=z, status=status, nis=(z**2).sum(axis=1))
    return replace(run, innovations=innovations), spans


@pytest.mark.parametrize(("drift", "windows"), [(1.0, 1), (1.0, 5), (1.0, 11), (1.2, 11)])
def test_a_drift_as_claimed_is_quiet(drift, windows):
    run, spans = with_outages(drift, windows)
    assert run_warnings(run, spans) == []


def test_a_drift_beyond_the_claim():
    run, spans = with_outages(3.0, 11)
    (warning,) = run_warnings(run, spans)
    assert warning.startswith("in the outages the solution drifted further than claimed: gnss_position ")
    assert "imu.grade" in warning


def test_few_measurements_say_nothing():
    assert run_warnings(result(30.0, n=8)) == []


def test_windows_are_left_out():
    assert run_warnings(result(3.0), exclude=[(0.0, 395.0)]) == []


@pytest.mark.parametrize("slip_deg", [90.0, 180.0, -90.0, 30.0])
def test_axes_turned_about_the_vertical(slip_deg):
    (warning,) = run_warnings(result(slip_deg=slip_deg, wander_deg=2.0))
    assert f"moves {slip_deg:.0f} deg off its forward axis" in warning.replace("-180 deg", "180 deg")


@pytest.mark.parametrize(
    "motion",
    [{"slip_deg": 10.0}, {"slip_deg": 90.0, "wander_deg": 40.0}, {"slip_deg": 90.0, "speed": 1.0}],
    ids=["crabbing", "drifting about", "slow"],
)
def test_no_such_vehicle(motion):
    assert run_warnings(result(**motion)) == []


def test_a_trajectory_without_attitude_says_nothing_of_axes():
    run = result(slip_deg=90.0)
    bare = Trajectory(run.forward.time, run.forward.lat, run.forward.lon, run.forward.height)
    assert run_warnings(Result(forward=bare, innovations=run.innovations)) == []


@pytest.mark.parametrize(("value", "told"), [(0.02, False), (0.12, True), (-0.12, True)])
def test_a_scale_factor_that_no_sensor_has(value, told):
    run = result()
    values = np.array([[0.0, 0.0, 0.0], [0.001, value, 0.0]])
    sd = np.array([[0.01, 0.01, 0.01], [0.001, 0.001, 0.001]])
    states = {"accel_scale": StateHistory(np.array([0.0, 1.0]), values, sd)}
    found = run_warnings(Result(forward=run.forward, innovations=run.innovations, states=states))
    assert len(found) == told
    assert not told or f"accel_scale {100.0 * value:+.1f} % where 1 % is usual" in found[0]


def test_biases_may_wander():
    run = result()
    history = StateHistory(np.array([0.0, 1.0]), np.array([[0.0] * 3, [9.0] * 3]), np.full((2, 3), 0.1))
    assert run_warnings(Result(forward=run.forward, innovations=run.innovations, states={"gyro_bias": history})) == []


def fixes():
    two = np.array([1.0, 2.0])
    return GnssLog(two, two, two, two, np.ones((2, 3)))


def test_a_run_without_any_used_fix():
    lost = Result(forward=result().forward, fixes=fixes())
    assert silence(lost) == ["no fix was used from 0.0 s to 399.0 s: inertial navigation alone"]


def test_a_run_with_two_fixes_only():
    run = result()
    (warning,) = silence(Result(forward=run.forward, innovations=run.innovations.select(np.array([5, 9]))))
    assert warning.startswith("no fix was used from 9.0 s to 399.0 s")


def test_a_run_that_never_wanted_fixes_says_nothing():
    assert run_warnings(Result(forward=result().forward)) == []


def test_a_dead_reckoned_track_is_told_of_its_own_keys():
    """No word of an inertial sensor where there is none; the same run with one names it."""
    nothing = np.zeros((2, 3))
    states = {"dr_position_error": StateHistory(np.arange(2.0), nothing, nothing + 1.0)}
    lost = result(3.0, rejected=60, slip_deg=90.0)
    lost = replace(lost, innovations=lost.innovations.select(lost.innovations.time < 200.0))
    runs = ((lost, []), with_outages(3.0, 11))
    inertial = [text for run, spans in runs for text in (*run_warnings(run, spans), *silence(run))]
    tracks = [(replace(run, states=states), spans) for run, spans in runs]
    dead = [text for run, spans in tracks for text in (*run_warnings(run, spans), *silence(run))]
    assert len(dead) == len(inertial) >= 4
    assert sum("imu." in text or "inertial" in text for text in inertial) >= 4
    assert not any("imu." in text or "inertial" in text for text in dead)
    assert any("Check, in this order: the time offset between the logs (dead_reckoning." in text for text in dead)
    assert any("dead reckoning alone" in text for text in dead)
