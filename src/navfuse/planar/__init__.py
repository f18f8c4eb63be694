"""Navigation in the plane, for a vehicle on flat ground: the smallest INS/GNSS that works, to learn from.

Three algorithms, each fed by the one before (Smalling and Eure, NASA/TM-2015-218803, 2015):

1. :mod:`navfuse.planar.yaw`: yaw from a magnetometer, accelerations to north and east.
2. :mod:`navfuse.planar.complementary`: yaw from magnetometer and gyro, a complementary filter on the direction cosine
   matrix; :mod:`navfuse.planar.mahony` is its form in space.
3. :mod:`navfuse.planar.position_filter`: two Kalman filters of position, velocity and acceleration.

Flat Earth without rotation, level vehicle, no sensor biases: for anything else there is ``navfuse run``. Frames, signs
and units are those of the package: body x forward, y right, z down; yaw clockwise from north.
"""

from navfuse.planar.checks import check_yaw_against_gyro
from navfuse.planar.complementary import complementary_yaw
from navfuse.planar.dead_reckoning import dead_reckon
from navfuse.planar.flat_earth import FlatEarth, metres_per_degree
from navfuse.planar.mahony import complementary_attitude, measured_dcm
from navfuse.planar.position_filter import ChannelNoise, PlanarTrack, filter_positions
from navfuse.planar.yaw import declination, hard_iron, magnetic_yaw, planar_dcm, to_north_east

__all__ = [
    "ChannelNoise",
    "FlatEarth",
    "PlanarTrack",
    "check_yaw_against_gyro",
    "complementary_attitude",
    "complementary_yaw",
    "dead_reckon",
    "declination",
    "filter_positions",
    "hard_iron",
    "magnetic_yaw",
    "measured_dcm",
    "metres_per_degree",
    "planar_dcm",
    "to_north_east",
]
