from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.io import savemat

from navfuse.errors import ConfigError, InputError
from navfuse.io.static_record import RecordLayout, read_static
from navfuse.io.tables import write_table

N, RATE, G = 200, 50.0, 9.80665


def columns(kind="rates", n=N):
    rng = np.random.default_rng(0)
    gyro, accel = rng.normal(0.0, 1e-3, (n, 3)), rng.normal([0.0, 0.0, -G], 1e-2, (n, 3))
    names = ("gyro_{}_radps", "accel_{}_mps2") if kind == "rates" else ("dtheta_{}_rad", "dvel_{}_mps")
    scale = 1.0 if kind == "rates" else 1.0 / RATE
    table = {"time_s": np.arange(n) / RATE}
    for name, values in zip(names, (gyro, accel), strict=True):
        table |= {name.format(axis): scale * values[:, k] for k, axis in enumerate("xyz")}
    return table


def write(path, table):
    write_table(path, table)
    return path


@pytest.mark.parametrize("kind", ["rates", "increments"])
def test_native_tables(tmp_path, kind):
    record = read_static(write(tmp_path / "log.csv", columns(kind)))
    assert record.kind == kind
    assert record.rate == pytest.approx(RATE)
    assert [c.name for c in record.channels] == [f"{s} {a}" for s in ("gyro", "accel") for a in "xyz"]
    assert record.channels[5].values == pytest.approx(columns()["accel_z_mps2"], rel=1e-9)
    assert record.notes == ()
    part = record.between(50, 60)
    assert part.start == pytest.approx(1.0)
    assert part.channels[0].values.size == 10


def test_units_and_temperature_of_native_tables(tmp_path):
    table = {"time_s": np.arange(N) / RATE, "gyro_x_degps": np.ones(N), "temp_c": np.full(N, 21.5)}
    record = read_static(write(tmp_path / "log.parquet", table))
    assert record.channels[0].values[0] == pytest.approx(math.radians(1.0))
    assert record.temperature[3] == 21.5


def test_gaps_are_places_without_samples(tmp_path):
    table = {name: np.delete(values, [100, 101]) for name, values in columns().items()}
    record = read_static(write(tmp_path / "log.csv", table))
    assert record.channels[0].values.size == N
    assert np.isnan(record.channels[0].values[100:102]).all()
    assert "1 gap in time, the first after 1.98 s" in record.notes[0]
    assert "2 of 200 samples are missing" in record.notes[1]


def test_arrays_by_name(tmp_path):
    table = columns()
    gyro = np.degrees(np.column_stack([table[f"gyro_{a}_radps"] for a in "xyz"]))
    accel = np.column_stack([table[f"accel_{a}_mps2"] for a in "xyz"]) / G
    np.savez(tmp_path / "log.npz", gyro_degps=gyro, accel_g=accel, rate_hz=RATE)
    record = read_static(tmp_path / "log.npz")
    assert record.rate == RATE
    assert record.channels[1].values == pytest.approx(table["gyro_y_radps"])
    savemat(tmp_path / "log.mat", {"w": gyro, "f": accel.T, "t": table["time_s"][:, None]})
    layout = RecordLayout(gyro="w", accel="f", gyro_unit="deg/s", accel_unit="g", time="t")
    record = read_static(tmp_path / "log.mat", layout)
    assert record.channels[5].values == pytest.approx(table["accel_z_mps2"])


@pytest.mark.parametrize("separator", [" ", ",", "\t", "; "])
def test_text_with_a_header_and_counts(tmp_path, separator):
    path = tmp_path / "log.imu"
    counts = np.random.default_rng(1).integers(-5, 5, (N, 6))
    counts[:, 5] = round(G / RATE / (125e-6 * G))
    rows = [separator.join(map(str, row)) for row in counts.tolist()]
    path.write_text("% a comment\n\n" + separator.join("123456") + "\n" + "\n".join(rows) + "\n")
    layout = RecordLayout("1,2,3", "4,5,6", "0.1 arcsec", "125 ug*s", rate_hz=RATE, skip_rows=1)
    record = read_static(path, layout)
    assert record.kind == "increments"
    assert record.channels[0].values == pytest.approx(counts[:, 0] * 0.1 * math.pi / 648000.0 * RATE)
    assert record.channels[5].values[0] == pytest.approx(G)


def test_columns_of_a_table_with_foreign_names(tmp_path):
    path = write(tmp_path / "log.csv", {"t": np.arange(N) / RATE, "wx": np.arange(N) ** 2.0})
    record = read_static(path, RecordLayout(gyro="wx", gyro_unit="deg/h", time="t"))
    assert record.channels[0].values[7] == pytest.approx(math.radians(49.0) / 3600.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: {"time_s": t["time_s"], "speed_mps": t["time_s"]}, "no column of an inertial sensor"),
        (lambda t: t | columns("increments"), "holds rates and increments"),
        (lambda t: t | {"time_s": np.where(np.arange(N) == 5, np.nan, t["time_s"])}, "time of row 6 is not a number"),
        (lambda t: t | {"time_s": np.where(np.arange(N) == 5, 0.0, t["time_s"])}, "time does not increase at row 6"),
        (lambda t: t | {"time_s": np.cumsum(np.tile([0.01, 0.03], N // 2))}, "samples are not regular"),
        (lambda t: t | {"time_s": t["time_s"] + 1e5 * (np.arange(N) > 9)}, "gaps make up more than 95 %"),
        (lambda t: t | {f"accel_{a}_mps2": t[f"accel_{a}_mps2"] / RATE for a in "xyz"}, "these are increments"),
        (
            lambda t: t | {f"accel_{a}_mps2": t[f"accel_{a}_mps2"] * 3.0 for a in "xyz"},
            "about 1 g: the unit is wrong, or the columns",
        ),
        (lambda t: {name: values[:1] for name, values in t.items()}, "1 samples are no record"),
        (lambda t: {k: v for k, v in t.items() if k != "time_s"}, "there is no time in the file"),
    ],
)
def test_native_tables_that_cannot_be_used(tmp_path, change, message):
    with pytest.raises(InputError, match=message):
        read_static(write(tmp_path / "log.csv", change(columns())))


def test_increments_that_are_rates_and_a_wrong_rate(tmp_path):
    table = columns("increments")
    rates = table | {f"dvel_{a}_mps": table[f"dvel_{a}_mps"] * RATE for a in "xyz"}
    with pytest.raises(InputError, match="these are rates; give units of rate and acceleration"):
        read_static(write(tmp_path / "log.csv", rates))
    path = write(tmp_path / "log.csv", columns())
    with pytest.raises(InputError, match=r"--rate 100 Hz contradicts the time stamps, whose steps make 50 Hz"):
        read_static(path, RecordLayout(rate_hz=100.0))
    with pytest.raises(ConfigError, match="--rate -1 must be a finite number"):
        read_static(path, RecordLayout(rate_hz=-1.0))
    del table["time_s"]
    with pytest.raises(InputError, match="the unit or the sampling rate is wrong, or"):
        read_static(write(tmp_path / "log.csv", table), RecordLayout(rate_hz=2.3 * RATE))
    np.savez(tmp_path / "log.npz", gyro_degps=np.ones((N, 3)), rate_hz=RATE)
    with pytest.raises(InputError, match="--rate 10 Hz contradicts the file, which says 50 Hz"):
        read_static(tmp_path / "log.npz", RecordLayout(rate_hz=10.0))


@pytest.mark.parametrize(
    ("layout", "error", "message"),
    [
        ({"gyro": "a,b,a", "gyro_unit": "deg/s"}, ConfigError, "column 'a' is named twice with --gyro and --accel"),
        ({"gyro": "a", "gyro_unit": "deg/s", "accel": "a", "accel_unit": "g"}, ConfigError, "'a' is named twice"),
        ({"gyro": "a", "gyro_unit": "deg/s", "accel_unit": "g"}, ConfigError, "--accel-unit 'g' is for columns that"),
        ({"gyro": "a", "gyro_unit": "deg/s", "skip_rows": 1}, ConfigError, "--skip-rows is for text without a header"),
        ({}, InputError, "say which of its columns to take with --gyro and --accel; it has a, b, c, d, e"),
        ({"gyro": "z", "gyro_unit": "deg/s"}, InputError, "no column 'z' for --gyro"),
        ({"gyro": "a"}, ConfigError, "the unit of 'a' is not known; give it with --gyro-unit"),
        ({"gyro": "a", "gyro_unit": "m"}, ConfigError, "wanted is angular rate"),
        ({"gyro": "a,b,e", "gyro_unit": "deg/s"}, ConfigError, "a sensor has at most three axes"),
        ({"gyro": "c", "gyro_unit": "deg/s"}, InputError, "'c' holds <U1, not numbers"),
        ({"gyro": "d", "gyro_unit": "deg/s"}, InputError, r"'d' has the shape \(4, 4\)"),
        ({"gyro": "a", "accel": "short", "gyro_unit": "deg/s", "accel_unit": "g"}, InputError, "different lengths"),
        (
            {"gyro": "a", "accel": "b", "gyro_unit": "arcsec", "accel_unit": "g"},
            ConfigError,
            "the gyros are increments and the accelerometers rates",
        ),
    ],
)
def test_layouts_that_do_not_fit(tmp_path, layout, error, message):
    path = tmp_path / "log.npz"
    np.savez(
        path, a=np.ones(5), b=np.ones(5), c=np.array(["x", "y"]), d=np.ones((4, 4)), e=np.ones((5, 2)), short=np.ones(3)
    )
    with pytest.raises(error, match=message):
        read_static(path, RecordLayout(rate_hz=10.0, **layout))


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("log.npz", b"PK\x03\x04 rubbish", "not a readable .npz file"),
        ("log.mat", b"rubbish " * 30, "not a readable .mat file"),
        ("log.txt", b"1 2 3\n4 x 6\n", "not a table of numbers"),
        ("log.txt", b"% only\n# comments\n", "no rows of numbers"),
        ("log.xyz", b"1 2 3\n", "cannot tell the format"),
    ],
)
def test_files_that_are_something_else(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_static(tmp_path / name, RecordLayout(gyro="1", gyro_unit="deg/s", rate_hz=1.0))


def test_infinite_values_are_missing(tmp_path):
    np.savez(tmp_path / "log.npz", gyro_degps=np.array([1.0, np.inf, 2.0]), rate_hz=1.0)
    record = read_static(tmp_path / "log.npz", RecordLayout(gyro="gyro_degps"))
    assert np.isnan(record.channels[0].values).tolist() == [False, True, False]
    assert (
        "gyro x (column 'gyro_degps'): values that are infinite count as missing: 1, the first in row 2"
        in record.notes[0]
    )


@pytest.mark.parametrize("option", ["gyro_unit", "accel_unit", "time"])
def test_units_of_native_tables_stand_in_their_names(tmp_path, option):
    path = write(tmp_path / "log.csv", columns())
    message = f"--{option.replace('_', '-')} 'g' is for columns that are named with --"
    with pytest.raises(ConfigError, match=message):
        read_static(path, RecordLayout(**{option: "g"}))


def test_axes_that_cannot_be_sensors(tmp_path):
    table = columns()
    nothing = table | {"gyro_y_radps": np.full(N, np.nan)}
    with pytest.raises(InputError, match=r"gyro y \(column 'gyro_y_radps'\) has no number in any of its 200 rows"):
        read_static(write(tmp_path / "log.csv", nothing))
    copy = table | {"gyro_z_radps": table["gyro_x_radps"]}
    with pytest.raises(
        InputError, match=r"gyro z \(column 'gyro_z_radps'\) is a copy of gyro x \(column 'gyro_x_radps'"
    ):
        read_static(write(tmp_path / "log.csv", copy))
    np.savetxt(tmp_path / "log.txt", np.column_stack(list(table.values())))
    layout = RecordLayout(gyro="1,2,3", gyro_unit="rad/s", rate_hz=RATE)
    with pytest.raises(InputError, match=r"gyro x \(column '1'\) changes by the same step at every row: it is a time"):
        read_static(tmp_path / "log.txt", layout)


def test_channels_that_are_constant_are_no_copies(tmp_path):
    np.savez(tmp_path / "log.npz", gyro_degps=np.zeros((N, 3)), rate_hz=RATE)
    assert len(read_static(tmp_path / "log.npz").channels) == 3


@pytest.mark.parametrize(
    ("stamps", "rate", "told"),
    [
        (np.arange(N) / RATE, 25.0, "column '1' rises steadily by 0.02, as time stamps in seconds at 50 Hz do, but"),
        (np.arange(N) * 20.0, 25.0, "column '1' rises steadily by 20, as time stamps in milliseconds at 50 Hz do"),
        (432000.0 + np.round(np.arange(N) / RATE, 3), 25.0, "as time stamps in seconds at 50 Hz do"),
        (np.arange(N) / RATE, RATE, None),
        (np.arange(N) * 20.0, RATE, None),
        (np.arange(N), 25.0, None),
        (np.arange(N)[::-1] / RATE, 25.0, None),
        (np.random.default_rng(2).normal(size=N), 25.0, None),
    ],
)
def test_a_rate_that_unused_time_stamps_contradict(tmp_path, stamps, rate, told):
    values = list(columns().values())
    np.savetxt(tmp_path / "log.txt", np.column_stack([stamps, *values[1:]]), fmt="%.12g")
    record = read_static(tmp_path / "log.txt", RecordLayout("2,3,4", "5,6,7", "rad/s", "m/s^2", rate_hz=rate))
    assert len(record.notes) == (told is not None)
    if told is not None:
        assert told in record.notes[0]
        assert "the rate is given as 25 Hz" in record.notes[0]


def test_stamps_in_another_unit_than_the_name_says(tmp_path):
    table = columns()
    record = read_static(write(tmp_path / "log.csv", table | {"time_s": 1000.0 * table["time_s"]}))
    assert "a sampling rate of 0.05 Hz is unusual for an inertial sensor" in record.notes[0]
    assert record.notes[0].endswith("Stamps in milliseconds, divided by 1000, would make it 50 Hz")
