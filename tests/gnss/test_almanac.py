from __future__ import annotations

import math

import numpy as np
import pytest

from navfuse.errors import InputError
from navfuse.gnss.almanac import read_almanac

YUMA = """******** Week 359 almanac for PRN-{prn} ********
ID:                         {prn}
Health:                     {health}
Eccentricity:               0.6118774414E-002
Time of Applicability(s):  589824.0000
Orbital Inclination(rad):   0.9341621399
Rate of Right Ascen(r/s):  -0.8180303725E-008
SQRT(A)  (m 1/2):           5153.627441
Right Ascen at Week(rad):   0.2740369081E+001
Argument of Perigee(rad):   1.624696112
Mean Anom(rad):             0.2341064516E+001
Af0(s):                    -0.1907348633E-004
Af1(s/s):                   0.0000000000E+000
week:                        359

"""
VALUES = {
    "eccentricity": 0.6118774414e-2,
    "toa": 589824.0,
    "inclination": 0.9341621399,
    "node_rate": -0.8180303725e-8,
    "semi_major": 5153.627441**2,
    "node": 2.740369081,
    "perigee": 1.624696112,
    "mean_anomaly": 2.341064516,
}
TWO = YUMA.format(prn="10", health="000") + YUMA.format(prn="02", health="000")


def sem(records=("10", "2"), health="0"):
    semicircles = {name: VALUES[name] / math.pi for name in ("node_rate", "node", "perigee", "mean_anomaly")}
    offset = VALUES["inclination"] / math.pi - 0.30
    lines = [f"{len(records)}  CURRENT.ALM", " 359 589824", ""]
    for prn in records:
        lines += [prn, "40", "0"]
        lines += [f" {VALUES['eccentricity']:.14E} {offset:.14E} {semicircles['node_rate']:.14E}"]
        lines += [f" 5153.627441 {semicircles['node']:.14E} {semicircles['perigee']:.14E}"]
        lines += [f" {semicircles['mean_anomaly']:.14E} -1.9E-05 0.0", health, "11", ""]
    return "\n".join(lines)


@pytest.fixture(name="read")
def _read(tmp_path):
    def read(text, name="week359.alm", **options):
        path = tmp_path / name
        path.write_bytes(text.encode("latin-1"))
        return read_almanac(path, **options)

    return read


@pytest.mark.parametrize(("text", "name"), [(TWO, "week.alm"), (TWO, "yuma.txt"), (sem(), "current.al3")])
def test_both_formats_hold_the_same(read, text, name):
    constellation = read(text, name)
    assert constellation.satellites == ("G02", "G10")
    for field, value in VALUES.items():
        np.testing.assert_allclose(getattr(constellation, field), [value, value], rtol=1e-12)
    assert np.linalg.norm(constellation.at(589824.0)[0][0], axis=1) == pytest.approx(2.66e7, rel=0.01)


def test_sick_satellites_are_left_out_unless_asked_for(read):
    text = TWO + YUMA.format(prn="31", health="063")
    assert read(text).satellites == ("G02", "G10")
    assert read(text, healthy_only=False).satellites == ("G02", "G10", "G31")
    with pytest.raises(InputError, match="no satellite of the almanac is healthy"):
        read(sem(health="63"), "a.al3")


@pytest.mark.parametrize(
    ("text", "name", "message"),
    [
        ("nothing here\n", "a.alm", "holds no satellite; a YUMA record begins"),
        (TWO.replace("0.9341621399", "0.9x"), "a.alm", r"line 6: '0.9x' is not a number"),
        (TWO.replace("0.9341621399", "nan"), "a.alm", r"line 6: 'nan' is not a finite number"),
        (TWO[:700], "a.alm", r"the record from line 17 on lacks .*perigee, mean_anomaly.*; is it cut off"),
        ("Health: 0\n" + TWO, "a.alm", "line 1: 'Health' stands before the first 'ID'"),
        (TWO + TWO, "a.alm", "'G02' is there twice"),
        (TWO.replace("5153.6", "51.6"), "a.alm", "runs through the Earth"),
        ("\xe4" + TWO, "a.alm", "characters that an almanac does not have"),
        ("CURRENT\n1 2\n", "a.al3", "line 1 has to begin with the number of records"),
        ("2 CURRENT\n359\n", "a.al3", "line 2 to hold week and time"),
        (sem()[:-40], "a.al3", r"2 records of 14 numbers are announced, \d+ are there; is it cut off"),
        (sem().replace("CURRENT.ALM", "CURRENT.ALM").replace("5153.627441", "x", 1), "a.al3", r"line \d+: 'x' is not"),
        (TWO, "a.csv", "cannot tell the format from '.csv'"),
    ],
)
def test_what_is_refused(read, text, name, message):
    with pytest.raises(InputError, match=message):
        read(text, name)
