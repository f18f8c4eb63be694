"""Dead reckoning from wheels, odometers, headings and velocities, and its integration with GNSS.

* :mod:`~navfuse.dead_reckoning.odometry`: logs -> a dead-reckoned track;
* :mod:`~navfuse.dead_reckoning.wheels`: wheel speeds -> speed and yaw rate of the vehicle;
* :mod:`~navfuse.dead_reckoning.integration`: any track, corrected by GNSS: six states, open or closed loop;
* :mod:`~navfuse.dead_reckoning.planar`: distance and turn steps with GNSS, when heading, gyro bias and odometer scale
  have to be estimated too;
* :mod:`~navfuse.dead_reckoning.checks`: wrong units and logs that do not belong together.
"""
