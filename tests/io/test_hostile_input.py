"""Whatever the bytes, a reader either understands them or says in one InputError what is wrong."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from navfuse.errors import InputError, NavfuseWarning
from navfuse.io.gnss_table import read_gnss
from navfuse.io.imu_table import read_imu
from navfuse.io.tables import write_table
from navfuse.io.trajectory_table import read_trajectory

READERS = {"imu": read_imu, "gnss": read_gnss, "trajectory": read_trajectory}
HEADERS = {
    "imu": "time_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2",
    "gnss": "time_s,lat_deg,lon_deg,height_m,sd_north_m,sd_east_m,sd_down_m,vn_mps,ve_mps,vd_mps,fix",
    "trajectory": "time_s,lat_deg,lon_deg,height_m,roll_deg,pitch_deg,heading_deg",
}
POS = (
    "%  GPST  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)"
    " vn(m/s) ve(m/s) vu(m/s) sdvn sdve sdvu\n"
)
XYZ = "%  UTC x-ecef(m) y-ecef(m) z-ecef(m) Q ns sdx(m) sdy(m) sdz(m) sdxy(m) sdyz(m) sdzx(m)\n"
hostile = settings(
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow, HealthCheck.filter_too_much],
    max_examples=150,
)
readers = pytest.mark.parametrize("reader", READERS)
numbers = st.floats() | st.integers(-(10**20), 10**20) | st.floats(-100.0, 100.0)
cells = (
    numbers.map(str)
    | st.sampled_from(["", "nan", "inf", "-", "1e999", "0", "1", "48.1", '"', "\x00", "é"])
    | st.text(max_size=4)
)


def survive(reader, path):
    """Read, allow navfuse's own errors and warnings only, and hold what was read to its contract."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", NavfuseWarning)
        try:
            log, message = READERS[reader](path), ""
        except InputError as error:
            log, message = None, str(error)
    if log is None:
        assert str(path) in message
        return
    assert (np.diff(log.time) > 0.0).all()
    if reader == "imu":
        assert log.time.size >= 2
        assert np.isfinite(log.gyro).all()
        assert np.isfinite(log.accel).all()
        return
    assert (np.abs(log.lat) <= np.pi / 2.0).all()
    assert (np.abs(log.lon) <= np.pi + 1e-12).all()
    assert np.isfinite(log.height).all()
    if reader == "gnss":
        assert (log.sd_position > 0.0).all()


@readers
@hostile
@given(content=st.binary(max_size=300), name=st.sampled_from(["a.csv", "a.parquet", "a.CSV"]))
@example(content=b"PAR1" + bytes(40) + b"PAR1", name="a.parquet")
@example(content=b"\xff\xfe" + "time_s".encode("utf-16-le"), name="a.csv")
@example(content=b"time_s\r0\r1\r", name="a.csv")
@example(content=b'"time_s', name="a.csv")
@example(content=b"," * 200, name="a.csv")
def test_random_bytes(tmp_path, reader, content, name):
    (tmp_path / name).write_bytes(content)
    survive(reader, tmp_path / name)


@readers
@hostile
@given(content=st.binary(max_size=200), newline=st.sampled_from(["\n", "\r\n", "\r"]))
@example(content=b"\n\n", newline="\n")
@example(content=b"0,1,2\n", newline="\n")
def test_random_bytes_after_a_header(tmp_path, reader, content, newline):
    (tmp_path / "a.csv").write_bytes((HEADERS[reader] + newline).encode() + content)
    survive(reader, tmp_path / "a.csv")


@readers
@hostile
@given(data=st.data())
def test_random_cells(tmp_path, reader, data):
    width = HEADERS[reader].count(",") + 1
    rows = data.draw(st.lists(st.lists(cells, min_size=width, max_size=width), max_size=5))
    text = "\n".join([HEADERS[reader], *(",".join(row) for row in rows)])
    (tmp_path / "a.csv").write_text(text, encoding="utf-8", newline="")
    survive(reader, tmp_path / "a.csv")


@readers
@hostile
@given(data=st.data())
def test_random_numbers(tmp_path, reader, data):
    names = [name for name in HEADERS[reader].split(",") if name != "fix"]
    n = data.draw(st.integers(1, 30))
    values = st.lists(st.floats() | st.floats(-90.0, 90.0), min_size=n, max_size=n)
    columns = {name: np.array(data.draw(values), dtype=np.float64) for name in names}
    if data.draw(st.booleans()):
        columns["time_s"] = np.sort(columns["time_s"])
    name = data.draw(st.sampled_from(["a.csv", "a.parquet"]))
    write_table(tmp_path / name, columns)
    survive(reader, tmp_path / name)


@hostile
@given(content=st.binary(max_size=200), header=st.sampled_from(["", POS, XYZ]))
def test_random_bytes_in_a_pos_file(tmp_path, content, header):
    (tmp_path / "a.pos").write_bytes(header.encode() + content)
    survive("gnss", tmp_path / "a.pos")


@hostile
@given(
    rows=st.lists(
        st.tuples(
            st.sampled_from(
                ["2270 ", "2023/07/11 06:04:00 ", "99999 0 ", "0001/01/01 00:00:00 ", "9999/12/31 99:99:99.9 "]
            ),
            st.lists(cells, max_size=18),
        ),
        max_size=6,
    ),
    header=st.sampled_from([POS, XYZ]),
)
def test_random_cells_in_a_pos_file(tmp_path, rows, header):
    text = header + "\n".join(time + " ".join(row) for time, row in rows)
    (tmp_path / "a.pos").write_text(text, encoding="utf-8", newline="")
    survive("gnss", tmp_path / "a.pos")


@readers
@pytest.mark.parametrize("seed", range(20))
def test_flipped_bytes_of_a_parquet_file(tmp_path, reader, seed):
    random = np.random.default_rng(seed)
    names = [name for name in HEADERS[reader].split(",") if name != "fix"]
    write_table(tmp_path / "a.parquet", {name: np.linspace(0.0, 1.0, 200) for name in names})
    content = np.frombuffer((tmp_path / "a.parquet").read_bytes(), dtype=np.uint8).copy()
    content[random.integers(0, content.size, 5)] = random.integers(0, 256, 5)
    (tmp_path / "a.parquet").write_bytes(content.tobytes())
    survive(reader, tmp_path / "a.parquet")


@readers
@pytest.mark.parametrize("length", range(0, 3000, 149))
def test_truncated_parquet_file(tmp_path, reader, length):
    names = [name for name in HEADERS[reader].split(",") if name != "fix"]
    write_table(tmp_path / "a.parquet", {name: np.linspace(0.0, 1.0, 200) for name in names})
    content = (tmp_path / "a.parquet").read_bytes()
    (tmp_path / "a.parquet").write_bytes(content[: min(length, len(content) - 1)])
    with pytest.raises(InputError):
        READERS[reader](tmp_path / "a.parquet")
