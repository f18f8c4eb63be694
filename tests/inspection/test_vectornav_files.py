"""Recordings of VectorNav sensors are named, and who reads them."""

import pytest

from navfuse.inspection.recognise import recognise
from navfuse.io.vectornav_ascii import sentence
from navfuse.io.vectornav_binary import layout_of, packet


@pytest.mark.parametrize("name", ["drive.log", "drive.bin"])
def test_vectornav(tmp_path, name):
    path = tmp_path / name
    if name.endswith("log"):
        path.write_text(sentence("VNYPR", "10.0,1.0,2.0") + "\n")
    else:
        path.write_bytes(packet(layout_of(["imu.gyro_radps"]), {"imu.gyro_radps": [1, 2, 3]}))
    assert "read_vectornav" in str(recognise(path))
