"""Ready-made sensor error models, by grade and by sensor, each with its source.

A data sheet's headline "in-run bias stability" is the floor of the Allan deviation of a unit that has been warm for
hours: the bias at switch-on is ten to a thousand times larger. Here ``*_bias_sd`` is always the root sum of squares
of *turn-on repeatability* (or the initial error) and the in-run figure, so that a filter started with it covers the
bias that is there. What happens afterwards follows from the in-run figure alone: a random walk that reaches it after
a stated time, 1000 s if not said otherwise, or a Gauss-Markov process where in-run change and repeatability are of
one size.

A limit printed as "plus-minus" without a sigma is taken as three sigma; a figure printed as "typical" as one.
Scale-factor tolerances of MEMS sensors are mostly temperature and ageing: a unit calibrated by its maker an hour ago
is better.

Vibration, mounting flexure and time-stamp jitter of a real installation are not in any data sheet and often exceed
the white noise that is: see ``icm-45686-car`` beside ``icm-45686`` for one car.

==================  ==================================================================================================
name                what
==================  ==================================================================================================
consumer            phone or hobby sensor, uncalibrated
industrial-mems     factory-calibrated MEMS unit, some hundred euros
tactical            ring-laser, fibre or best MEMS, 1 deg/h
navigation          ring-laser or fibre, 1 nautical mile per hour unaided
benchmark-car       what the simulated benchmark drive ``car-1h-200hz`` was made with
adis16405           Analog Devices ADIS16405 (2009), as in ``adis16405-static`` and ``navego-synthetic`` imu1
adis16488           Analog Devices ADIS16488, as in ``navego-synthetic`` imu2
rt3003              OXTS RT3003, as in ``kitti-raw-100hz``
lsm6ds3             ST LSM6DS3, the phone in ``comma2k19-example1``
icm-45686           TDK ICM-45686 from its data sheet, as in ``rtklibexplorer-drive``
icm-45686-car       the same sensor with the vibration of that car
vn-100, vn-200      VectorNav VN-100 and VN-200 (same inertial sensors)
ring-laser          ring-laser unit as in ``psins``
==================  ==================================================================================================
"""

from __future__ import annotations

import math
from types import MappingProxyType
from typing import TYPE_CHECKING

from navfuse.core.nearest import nearest
from navfuse.errors import ConfigError
from navfuse.imu.error_model import ImuErrorModel

if TYPE_CHECKING:
    from collections.abc import Mapping


def _rss(turn_on: float, in_run: float) -> float:
    return math.hypot(turn_on, in_run)


def _walk(in_run: float, seconds: float = 1000.0) -> float:
    """Density per sqrt(h) of a random walk whose standard deviation is `in_run` after `seconds`."""
    return in_run * math.sqrt(3600.0 / seconds)


_VECTORNAV = ImuErrorModel.from_datasheet(
    source=(
        "VectorNav VN-100/VN-200 product brief: 0.0035 deg/s/sqrt(Hz), in-run < 10 deg/h; 0.14 mg/sqrt(Hz), in-run "
        "< 0.04 mg; alignment 0.05 deg. Turn-on repeatability is not printed: 0.05 deg/s, 5 mg and 0.1 % are our "
        "estimates"
    ),
    gyro_noise_degps_per_sqrt_hz=0.0035,
    accel_noise_ug_per_sqrt_hz=140.0,
    gyro_bias_sd_dph=_rss(180.0, 10.0),
    gyro_bias_walk_dph_per_sqrt_h=_walk(10.0),
    accel_bias_sd_mg=_rss(5.0, 0.04),
    accel_bias_walk_mg_per_sqrt_h=_walk(0.04),
    gyro_scale_sd_ppm=1000.0,
    accel_scale_sd_ppm=1000.0,
)

_ICM_45686 = ImuErrorModel.from_datasheet(
    source=(
        "TDK ICM-45686 data sheet: 3.8 mdeg/s/sqrt(Hz), 70 ug/sqrt(Hz); offset 0.5 deg/s and 10 mg, sensitivity "
        "0.5 % and cross-axis 0.3 % are our estimates for a soldered part; walks 3.8e-5 deg/s/sqrt(s) and 7 "
        "ug/sqrt(s) as the owner of rtklibexplorer-drive tuned them, the size of some kelvin of warming in ten "
        "minutes"
    ),
    gyro_noise_degps_per_sqrt_hz=0.0038,
    accel_noise_ug_per_sqrt_hz=70.0,
    gyro_bias_sd_degps=0.5,
    gyro_bias_walk_dph_per_sqrt_h=3.8e-5 * 3600.0 * 60.0,
    accel_bias_sd_mg=10.0,
    accel_bias_walk_mg_per_sqrt_h=7e-3 * 60.0,
    gyro_scale_sd_ppm=5000.0,
    accel_scale_sd_ppm=5000.0,
)

GRADES: Mapping[str, ImuErrorModel] = MappingProxyType(
    {
        "consumer": ImuErrorModel.from_datasheet(
            source=(
                "middle of ST LSM6DSO, Bosch BMI160/270 and InvenSense MPU-6500/ICM-20948 data sheets: 0.004-0.015 "
                "deg/s/sqrt(Hz), 70-300 ug/sqrt(Hz), offsets 0.5-5 deg/s and 20-60 mg, 1-3 % sensitivity, 1-2 % "
                "cross-axis, 0.01-0.05 deg/s/K and 0.1-1 mg/K: walks are some kelvin in ten minutes"
            ),
            gyro_noise_degps_per_sqrt_hz=0.007,
            accel_noise_ug_per_sqrt_hz=150.0,
            gyro_bias_sd_degps=1.0,
            gyro_bias_walk_dph_per_sqrt_h=_walk(100.0, 600.0),
            accel_bias_sd_mg=30.0,
            accel_bias_walk_mg_per_sqrt_h=_walk(0.5, 600.0),
            gyro_scale_sd_ppm=10000.0,
            accel_scale_sd_ppm=10000.0,
        ),
        "industrial-mems": ImuErrorModel.from_datasheet(
            source=(
                "middle of ADIS16465, SBG Ellipse 2 and Xsens MTi-10/100 data sheets: 0.15-0.3 deg/sqrt(h), "
                "0.012-0.07 m/s/sqrt(h), in-run 2-10 deg/h and 4-40 ug, repeatability 0.02-0.2 deg/s and 1-5 mg, "
                "scale 0.05-0.1 %, alignment 0.05 deg"
            ),
            arw_deg_per_sqrt_h=0.2,
            vrw_mps_per_sqrt_h=0.06,
            gyro_bias_sd_dph=_rss(100.0, 7.0),
            gyro_bias_walk_dph_per_sqrt_h=_walk(7.0),
            accel_bias_sd_mg=_rss(2.0, 0.03),
            accel_bias_walk_mg_per_sqrt_h=_walk(0.03),
            gyro_scale_sd_ppm=1000.0,
            accel_scale_sd_ppm=1000.0,
        ),
        "tactical": ImuErrorModel.from_datasheet(
            source=(
                "Honeywell HG1700 brochure: gyro 1 deg/h, 0.125 deg/sqrt(h), accelerometer 1 mg, 0.065 "
                "ft/s/sqrt(h); Sensonor STIM300 data sheet: turn-on 4 deg/h and 0.75 mg, in-run 0.5 deg/h and 0.05 "
                "mg, 0.15 deg/sqrt(h), 0.07 m/s/sqrt(h). Between the two; scale 150 and 300 ppm, alignment 0.2 "
                "mrad"
            ),
            arw_deg_per_sqrt_h=0.125,
            vrw_mps_per_sqrt_h=0.05,
            gyro_bias_sd_dph=1.0,
            gyro_bias_tau_s=3600.0,
            accel_bias_sd_mg=_rss(1.0, 0.05),
            accel_bias_walk_mg_per_sqrt_h=_walk(0.05),
            gyro_scale_sd_ppm=150.0,
            accel_scale_sd_ppm=300.0,
        ),
        "navigation": ImuErrorModel.from_datasheet(
            source=(
                "Honeywell HG9900 data sheet: gyro bias < 0.003 deg/h, < 0.002 deg/sqrt(h), < 5 ppm; accelerometer "
                "bias < 25 ug, < 100 ppm; white noise of a quartz accelerometer 5 ug/sqrt(Hz); alignment 5 arcsec. "
                "Limits taken as one sigma"
            ),
            arw_deg_per_sqrt_h=0.002,
            accel_noise_ug_per_sqrt_hz=5.0,
            gyro_bias_sd_dph=0.003,
            gyro_bias_tau_s=3600.0,
            accel_bias_sd_mg=0.025,
            accel_bias_tau_s=3600.0,
            gyro_scale_sd_ppm=5.0,
            accel_scale_sd_ppm=100.0,
        ),
        "benchmark-car": ImuErrorModel.from_datasheet(
            source=(
                "the parameters that car-1h-200hz was simulated with; they describe a good industrial MEMS unit "
                "without its turn-on error"
            ),
            arw_deg_per_sqrt_h=0.2,
            vrw_mps_per_sqrt_h=0.1,
            gyro_bias_sd_dph=30.0,
            gyro_bias_tau_s=3600.0,
            accel_bias_sd_mgal=150.0,
            accel_bias_tau_s=3600.0,
            gyro_scale_sd_ppm=300.0,
            accel_scale_sd_ppm=300.0,
        ),
        "adis16405": ImuErrorModel.from_datasheet(
            source=(
                "Analog Devices ADIS16405 data sheet: 2.0 deg/sqrt(h), 0.2 m/s/sqrt(h), initial 3 deg/s and 50 mg, "
                "in-run 0.007 deg/s and 0.2 mg, sensitivity 1 %, misalignment 0.05 deg; walks reach the in-run "
                "figure in 100 s, which the Allan deviation of adis16405-static confirms for the gyros (0.005 to "
                "0.017 deg/s at 1000 s) and passes for its accelerometers (up to 1.7 mg)"
            ),
            arw_deg_per_sqrt_h=2.0,
            vrw_mps_per_sqrt_h=0.2,
            gyro_bias_sd_degps=_rss(3.0, 0.007),
            gyro_bias_walk_dph_per_sqrt_h=_walk(0.007 * 3600.0, 100.0),
            accel_bias_sd_mg=_rss(50.0, 0.2),
            accel_bias_walk_mg_per_sqrt_h=_walk(0.2, 100.0),
            gyro_scale_sd_ppm=3000.0,
            accel_scale_sd_ppm=3000.0,
        ),
        "adis16488": ImuErrorModel.from_datasheet(
            source=(
                "Analog Devices ADIS16488 data sheet: 0.3 deg/sqrt(h), 0.029 m/s/sqrt(h), repeatability 0.2 deg/s "
                "and 16 mg, in-run 6.25 deg/h and 0.1 mg, sensitivity 1 % and 0.5 %, misalignment 0.05 deg; walks "
                "reach the in-run figure in 100 s"
            ),
            arw_deg_per_sqrt_h=0.3,
            vrw_mps_per_sqrt_h=0.029,
            gyro_bias_sd_dph=_rss(720.0, 6.25),
            gyro_bias_walk_dph_per_sqrt_h=_walk(6.25, 100.0),
            accel_bias_sd_mg=_rss(16.0, 0.1),
            accel_bias_walk_mg_per_sqrt_h=_walk(0.1, 100.0),
            gyro_scale_sd_ppm=3000.0,
            accel_scale_sd_ppm=2000.0,
        ),
        "rt3003": ImuErrorModel.from_datasheet(
            source=(
                "OXTS RT3000 manual: angular rate bias 0.01 deg/s, scale 0.1 %; acceleration bias 10 mm/s^2, scale "
                "0.1 % (all one sigma); gyro in-run 2 deg/h, 0.2 deg/sqrt(h); 0.005 m/s/sqrt(h). Logs that it has "
                "corrected with its own filter have smaller biases"
            ),
            arw_deg_per_sqrt_h=0.2,
            vrw_mps_per_sqrt_h=0.005,
            gyro_bias_sd_dph=_rss(36.0, 2.0),
            gyro_bias_walk_dph_per_sqrt_h=_walk(2.0),
            accel_bias_sd_mgal=1000.0,
            accel_bias_walk_mg_per_sqrt_h=_walk(0.02),
            gyro_scale_sd_ppm=1000.0,
            accel_scale_sd_ppm=1000.0,
        ),
        "lsm6ds3": ImuErrorModel.from_datasheet(
            source=(
                "ST LSM6DS3 data sheet: 7 mdeg/s/sqrt(Hz), 90 ug/sqrt(Hz), zero-rate 10 deg/s and zero-g 40 mg "
                "(limits, a third taken), sensitivity 1 %, 0.05 deg/s/K and 0.5 mg/K: walks are two kelvin in ten "
                "minutes"
            ),
            gyro_noise_degps_per_sqrt_hz=0.007,
            accel_noise_ug_per_sqrt_hz=90.0,
            gyro_bias_sd_degps=3.3,
            gyro_bias_walk_dph_per_sqrt_h=_walk(360.0, 600.0),
            accel_bias_sd_mg=13.0,
            accel_bias_walk_mg_per_sqrt_h=_walk(1.0, 600.0),
            gyro_scale_sd_ppm=10000.0,
            accel_scale_sd_ppm=10000.0,
        ),
        "icm-45686": _ICM_45686,
        "icm-45686-car": _ICM_45686.replace_datasheet(
            gyro_noise_degps_per_sqrt_hz=0.04,
            accel_noise_ug_per_sqrt_hz=1000.0,
            gyro_bias_walk_dph_per_sqrt_h=_walk(100.0, 600.0),
            accel_bias_walk_mg_per_sqrt_h=_walk(0.5, 600.0),
            accel_scale_sd_ppm=10000.0,
        ).replace(
            source=(
                "ICM-45686 with the white noise that the Allan deviation of rtklibexplorer-drive shows with the "
                "engine idling (28 s standing, at 1 s: up to 0.04 deg/s and 0.8 mg) and its |f| 1.3 % high; walks "
                "as for the consumer grade"
            )
        ),
        "vn-100": _VECTORNAV,
        "vn-200": _VECTORNAV,
        "ring-laser": ImuErrorModel.from_datasheet(
            source=(
                "typical of 90-type ring-laser units with quartz accelerometers: 0.01 deg/h, 0.002 deg/sqrt(h), 50 "
                "ug, 5 ug/sqrt(Hz), 10 and 50 ppm; the static log of psins bounds its down gyro by 0.022 "
                "deg/sqrt(h) (Allan deviation 0.08 deg/h at 300 s, still falling as 1/tau: quantisation)"
            ),
            arw_deg_per_sqrt_h=0.002,
            accel_noise_ug_per_sqrt_hz=5.0,
            gyro_bias_sd_dph=0.01,
            gyro_bias_tau_s=3600.0,
            accel_bias_sd_mg=0.05,
            accel_bias_tau_s=3600.0,
            gyro_scale_sd_ppm=10.0,
            accel_scale_sd_ppm=50.0,
        ),
    }
)
"""Name -> :class:`~navfuse.imu.error_model.ImuErrorModel`; read-only. Each ``source`` names its figures' origin."""


def grade(name: str) -> ImuErrorModel:
    """A ready-made model by name.

    Parameters
    ----------
    name : str
        A key of :data:`GRADES`.

    Raises
    ------
    ConfigError
        For an unknown name; the message names the nearest and lists all.
    """
    if name not in GRADES:
        close = nearest(name.lower(), GRADES)
        hint = f"did you mean {close!r}? " if close else ""
        raise ConfigError(f"unknown IMU grade {name!r}: {hint}known: {', '.join(GRADES)}")
    return GRADES[name]
