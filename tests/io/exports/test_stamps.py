from __future__ import annotations

import numpy as np
import pytest

from navfuse.data.gps_epoch import GpsEpoch
from navfuse.errors import ConfigError, InputError
from navfuse.io.exports.kitti import write_kitti
from navfuse.io.exports.nmea import write_nmea
from navfuse.io.exports.parts import check_parts, fix_codes
from navfuse.io.exports.pos import write_pos
from navfuse.io.exports.sbet import write_sbet
from navfuse.io.exports.smrmsg import write_smrmsg
from navfuse.io.exports.stamps import clocks, dates, gps_ticks
from navfuse.io.exports.tum import write_tum
from reference.export_tracks import export_track

DATED = [write_pos, write_nmea, write_sbet, write_smrmsg]
EVERY = [*DATED, write_tum, write_kitti]


@pytest.mark.parametrize("write", DATED)
def test_no_epoch(write, tmp_path):
    with pytest.raises(ConfigError, match=r"gnss\.epoch_week_s.*--epoch WEEK,SECONDS"):
        write(tmp_path / "file", export_track(epoch=None))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("write", [write_tum, write_kitti])
def test_formats_that_need_no_epoch(write, tmp_path):
    write(tmp_path / "file", export_track(epoch=None))
    assert (tmp_path / "file").is_file()


def test_before_gps_time(tmp_path):
    with pytest.raises(ConfigError, match="before 1980-01-06"):
        write_pos(tmp_path / "file.pos", export_track(10, epoch=GpsEpoch(0, 0.0), time=np.arange(10) - 5.0))


@pytest.mark.parametrize("write", EVERY)
def test_not_a_number(write, tmp_path):
    track = export_track(20)
    track.trajectory.height[7] = np.nan
    with pytest.raises(InputError, match=r"epoch 8 \(at 0\.7 s\): height is not a number"):
        write(tmp_path / "file", track)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["undulation", "a_eb_b", "w_nb_b"])
def test_not_a_number_beside_the_trajectory(name):
    track = export_track(20)
    getattr(track, name)[3] = np.inf
    with pytest.raises(InputError, match=f"epoch 4 .*{name} is not a number"):
        check_parts(track, "anything")


@pytest.mark.parametrize("write", EVERY)
def test_no_epochs_at_all(write, tmp_path):
    track = export_track(0)
    with pytest.raises(InputError, match="there is no epoch to write"):
        write(tmp_path / "file", track)


@pytest.mark.parametrize(
    ("write", "part", "words"),
    [
        (write_sbet, "velocity_n", "a velocity"),
        (write_sbet, "attitude", "an attitude"),
        (write_smrmsg, "sd_attitude", "standard deviations of the attitude"),
        (write_tum, "attitude", "an attitude"),
        (write_kitti, "attitude", "an attitude"),
    ],
)
def test_a_part_is_missing(write, part, words, tmp_path):
    with pytest.raises(InputError, match=f"needs {words}, the trajectory has none"):
        write(tmp_path / "file", export_track(**{part: None}))


@pytest.mark.parametrize(
    ("time", "at_least", "decimals"),
    [([0.0, 0.01, 0.29], 2, 2), ([0.0, 0.005], 2, 3), ([0.0, 0.01], 3, 3), ([0.0, 0.0125, 0.01250001], 2, 6)],
)
def test_decimals(time, at_least, decimals):
    track = export_track(len(time), epoch=GpsEpoch(2300, 345678.0), time=np.array(time))
    ticks, found = gps_ticks(track, "x", at_least)
    assert found == decimals
    start = (2300 * 604800 + 345678) * 10**decimals
    assert ticks.tolist() == [start + round(value * 10**decimals) for value in time]


def test_a_clock_never_shows_sixty_seconds():
    """59.999 of a minute is not rounded up within the minute, nor 23:59:59.999 within the day."""
    track = export_track(2, epoch=GpsEpoch(2300, 86400.0 - 1.0), time=np.array([0.9999999, 1.9999999]))
    ticks, decimals = gps_ticks(track, "x", 2)
    assert decimals == 2
    days, ticks_of_day = np.divmod(ticks, 8640000)
    assert clocks(ticks_of_day, decimals, ":") == ["00:00:00.00", "00:00:01.00"]
    assert dates(days) == ["2024-02-05", "2024-02-05"]


def test_fix_codes():
    track = export_track(4, fix=np.array(["RTK-fixed", "none", "3d", "single"]))
    assert fix_codes(track, {"rtk-fixed": 4, "none": 6, "single": 1}, 9).tolist() == [4, 6, 9, 1]
    assert fix_codes(export_track(2, fix=None), {"single": 1}, 9).tolist() == [9, 9]
