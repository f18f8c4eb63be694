"""The unscented feedback filter of twelve states: navigation, and the position error that is fed back at every fix.

The state is ``[L, lambda, h, roll, pitch, heading, v_N, v_E, v_D, e_L, e_lambda, e_h]``: no sensor biases, but what the
inertial position has gone wrong by since it was last corrected. That error e is seen in the difference of inertial and
GNSS position, and fed back into the position at once. See docs/decisions/0012.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from navfuse.aiding.base import AidingSensor, noise_covariance
from navfuse.core.constants import STANDARD_GRAVITY
from navfuse.core.earth import radii
from navfuse.core.unscented import triangularize
from navfuse.data.layout import Block
from navfuse.data.nav_state import NavState, boxplus_navigation
from navfuse.data.start import Start
from navfuse.errors import ConfigError
from navfuse.filters.event import parts, room
from navfuse.filters.record import USED, Innovation
from navfuse.filters.settings import FilterSettings
from navfuse.filters.unscented import UnscentedFilter
from navfuse.imu.error_model import ImuErrorModel
from navfuse.mechanization.sigma_points import covariance_of_root

Array = np.ndarray

POSITION_SENSOR = "gnss_position"
TURN_RATE = 0.1
"""Rate [rad/s] at which a scale-factor error of the gyros is counted."""
WALKED_S = 3600.0
"""Time [s] over which a bias that walks is counted."""
UNSEEN_S = 60.0
"""Time [s] for which a vehicle may keep its velocity, so that nothing is seen of its heading."""


class DriftingPosition(AidingSensor):
    """A position sensor that takes the inertial position to be wrong by an error e of its own: it predicts what the
    sensor inside predicts at the position less e.

    Parameters
    ----------
    inside : AidingSensor
    walk : float [m/sqrt(s)]
        Square root of the density with which each component of e wanders.

    Notes
    -----
    Adds the block ``error`` (3,): north, east, down [m], inertial position less true one.
    """

    def __init__(self, inside: AidingSensor, walk: float):
        self.inside = inside
        self.name = inside.name
        self.states = (*inside.states, Block("error", 3, 0.0, walk=walk))
        self._block = f"{self.name}.error"

    @property
    def times(self) -> Array:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Those of the sensor inside."""
        return self.inside.times

    @property
    def gate(self) -> float | None:  # pyright: ignore[reportIncompatibleVariableOverride]
        """That of the sensor inside."""
        return self.inside.gate

    def value(self, k: int) -> Array:
        """As the sensor inside."""
        return self.inside.value(k)

    def predict(self, nav: NavState, k: int) -> Array:
        """What the sensor inside predicts at the position less e."""
        d = np.zeros(nav.layout.size)
        d[:3] = -nav.C_nm.T @ nav.state(self._block)
        return self.inside.predict(nav.boxplus(d), k)

    def noise(self, k: int) -> Array | float:
        """As the sensor inside."""
        return self.inside.noise(k)

    def subtract(self, measured: Array, predicted: Array) -> Array:
        """As the sensor inside."""
        return self.inside.subtract(measured, predicted)

    def withheld(self, k: int) -> bool:
        """As the sensor inside."""
        return self.inside.withheld(k)

    def log_row(self, k: int) -> int:
        """As the sensor inside."""
        return self.inside.log_row(k)


def left_out(sensors: Sequence[AidingSensor], observed: Sequence[str], estimator: str) -> list[str]:
    """A note on the sensors that an estimator does not use, if there are any."""
    names = [sensor.name for sensor in sensors if sensor.name not in (*observed, "gnss_velocity")]
    return [f'estimator = "{estimator}" does not use {", ".join(names)}'] if names else []


@dataclass(frozen=True, slots=True)
class PositionErrors:
    """What a feedback filter has fed back.

    Attributes
    ----------
    time : (m,) array [s]
    error, sd : (m, 3) arrays [m]
        e north, east, down, inertial position less true one, and its standard deviations before it was fed back.
    angles : (m, 3) array [rad], [rad], [m]
        The same error as e_L, e_lambda and e_h.
    """

    time: Array
    error: Array
    sd: Array
    angles: Array


class FeedbackFilter(UnscentedFilter):
    """Unscented filter of twelve states that feeds the error of the position back after every fix it uses.

    Parameters
    ----------
    start, imu_model, settings
        See :class:`~navfuse.filters.navigation_filter.NavigationFilter`.
    sensors : sequence of AidingSensor
        One is called ``gnss_position``.
    walk : float [m/sqrt(s)], optional
        Of the position error; default what unknown biases make of a position between two fixes, see :func:`tuning`.
    observed : sequence of str
        Names of the sensors that are used; others are left out.

    Raises
    ------
    ConfigError
        Without a position sensor, for a walk that is negative or not finite, or as
        :class:`~navfuse.filters.unscented.UnscentedFilter`.

    Notes
    -----
    Feeding back is the linear map ``p <- p - e, e <- 0`` of estimate and errors; the root of the covariance is mapped
    in the same way, so that what is known of the position stays, and e is what has gone wrong since: exactly nothing at
    first. So the filter is the same as one of nine states whose position wanders with the density of e.
    """

    def __init__(
        self,
        start: Start,
        imu_model: ImuErrorModel,
        sensors: Sequence[AidingSensor] = (),
        settings: FilterSettings | None = None,
        walk: float | None = None,
        observed: Sequence[str] = (POSITION_SENSOR,),
    ):
        position = named(sensors, POSITION_SENSOR, "ukf-feedback-12")
        model, derived = tuning(imu_model, position)
        walk = derived if walk is None else walk
        if not (np.isfinite(walk) and walk >= 0.0):
            raise ConfigError(f"the walk of the position error must be finite and not negative, not {walk} m/sqrt(s)")
        self._position = DriftingPosition(position, walk)
        self._due = False
        self._fed: tuple[Array, Array] | None = None
        self._history: list[Array] = []
        used = [s for s in sensors if s.name in observed]
        super().__init__(start, model, [self._position if s is position else s for s in used], settings)
        self.record.notes += left_out(sensors, observed, "ukf-feedback-12")

    def _use(self, sensor: AidingSensor, k: int, limit: Callable[[int], float] | None) -> tuple[float, int, Array]:
        used: list[float] = []

        def kept(d: int) -> float:
            used.append(limit(d) if limit is not None else -1.0)
            return used[-1]

        nis, d, numbers = super()._use(sensor, k, kept)
        self._due |= sensor is self._position and bool(nis <= used[0])
        return nis, d, numbers

    def _finish_event(self) -> None:
        self._fed = self._feed_back() if self._due else None
        self._due = False
        super()._finish_event()

    def _feed_back(self) -> tuple[Array, Array]:
        """Take e out of the position; what it was, and its standard deviations."""
        at = self.layout.slice("gnss_position.error")
        where = slice(at.start - 9, at.stop - 9)
        nav = self._seen()
        e, sd, turn = self.s[where].copy(), np.sqrt(np.diagonal(self.P)[at]), nav.C_nm.T
        R_N, R_E = radii(np.sin(nav.lat))
        angles = (e[0] / (R_N + nav.height), e[1] / ((R_E + nav.height) * np.cos(nav.lat)), -e[2])
        self._history.append(np.array([self.time, *e, *sd, *angles]))
        d = np.zeros(9)
        d[:3] = -turn @ e
        boxplus_navigation(self.nav, d, self.settings.ecef)
        self.s[where] = 0.0
        A = self.root.copy()
        A[:3] -= turn @ A[at]
        A[at] = 0.0
        triangularize(A, A.shape[1], self.root)
        covariance_of_root(self._acc, self.P)
        return e, sd

    def _note(self, put: bool) -> Array:
        """As the base, but the error is told as it was before it was fed back."""
        states = super()._note(put)
        if self._fed is not None:
            at = self.layout.slice("gnss_position.error")
            states[:, at.start - 9 : at.stop - 9] = self._fed
        return states

    def _keep_checkpoint(self, at: int, updates: tuple[Innovation, ...]) -> None:
        """As the base; the feedback is told as the last of the updates, one that measures nothing: I - K H is its map
        and S^-1 = 0.
        """
        if self._fed is not None and self.settings.checkpoints:
            n, error = self.layout.size, self.layout.slice("gnss_position.error")
            numbers = np.zeros(room(3, n))
            _, _, _, H, K, _ = parts(numbers, 3, n)
            H[:, error] = np.eye(3)
            K[error] = np.eye(3)
            K[:3] = self._seen().C_nm.T
            updates = (*updates, Innovation(self.time, self._position.name, -1, USED, np.nan, 3, numbers))
        super()._keep_checkpoint(at, updates)

    def position_errors(self) -> PositionErrors:
        """What has been fed back since the filter was made."""
        rows = np.array(self._history).reshape(-1, 10)
        return PositionErrors(rows[:, 0], rows[:, 1:4], rows[:, 4:7], rows[:, 7:])


def named(sensors: Sequence[AidingSensor], name: str, estimator: str) -> AidingSensor:
    """The sensor of a name.

    Raises
    ------
    ConfigError
        If there is none.
    """
    for sensor in sensors:
        if sensor.name == name:
            return sensor
    others = ", ".join(sensor.name for sensor in sensors) or "none"
    raise ConfigError(f'the estimator "{estimator}" needs {name}; the sensors given: {others}')


def tuning(model: ImuErrorModel, position: AidingSensor) -> tuple[ImuErrorModel, float]:
    """An error model without sensor states for a filter that is corrected by positions, and the walk of their error.

    Parameters
    ----------
    model : ImuErrorModel
    position : AidingSensor
        Gives the interval T of the fixes and their noise sigma, both medians.

    Returns
    -------
    ImuErrorModel
        Without biases, scale factors and cross-coupling; its white noise covers them.
    float [m/sqrt(s)]
        Walk of the position error: a bias b_a of the accelerometer and b_g of a gyro shift the position between two
        fixes by b_a T^2 / 2 and g b_g T^3 / 6.

    Notes
    -----
    A filter that follows positions of density r = sigma^2 T with white acceleration noise of density q settles at a
    variance of the velocity of sqrt(2) r^(1/4) q^(3/4), of which the fixes make a quarter; an unknown constant
    acceleration b leaves it with an error of sqrt(2) b (r / q)^(1/4). The other three quarters cover that for

        q_a = (4 sqrt(2) / 3 b^2)^(4/5) r^(1/5)

    In the same way a tilt that is found with accelerations of density q_a settles at a variance of sqrt(q_g q_a) / g.
    Half of that covers what a drift b_g of the gyros leaves, b_g sqrt(q_a / q_g) / g, for the first term of q_g; with
    the second alone the variance is that of the tilt b / g which an accelerometer bias is taken for:

        q_g = (2 b_g^2 sqrt(q_a) / g)^(2/3) + b^4 / (g^2 q_a) + b_g^2 UNSEEN_S

    The last term is what a heading drifts by while nothing is seen of it.
    Scale-factor and cross-coupling errors count as biases at one g and TURN_RATE, walks over WALKED_S.
    """
    g = STANDARD_GRAVITY
    b = _bias(model, "accel", g)
    b_g = _bias(model, "gyro", TURN_RATE)
    T, sigma = _fixes(position)
    q_a = (4.0 * np.sqrt(2.0) / 3.0 * b**2) ** 0.8 * (sigma**2 * T) ** 0.2
    total = model.vrw**2 + q_a
    q_g = (2.0 * b_g**2 * np.sqrt(total) / g) ** (2.0 / 3.0) + b_g**2 * UNSEEN_S
    if b > 0.0:
        q_g += b**4 / (g**2 * total)
    drift = np.hypot(0.5 * b * T**2, g * b_g * T**3 / 6.0)
    plain = ImuErrorModel(arw=float(np.sqrt(model.arw**2 + q_g)), vrw=float(np.sqrt(total)), source=model.source)
    return plain, float(drift / np.sqrt(T))


def _bias(model: ImuErrorModel, sensor: str, size: float) -> float:
    """Root mean square over the axes of all that is nearly constant, for an input of a size."""
    bias, walk, scale = (model.axes(f"{sensor}_{name}") for name in ("bias_sd", "bias_walk", "scale_sd"))
    cross = getattr(model, f"{sensor}_cross_sd")
    return float(np.sqrt(np.mean(bias**2 + walk**2 * WALKED_S + (scale**2 + cross**2) * size**2)))


def _fixes(position: AidingSensor) -> tuple[float, float]:
    """Median interval [s] and noise [m] of fixes; a second and a metre where there are too few to tell."""
    count = len(position.times)
    interval = float(np.median(np.diff(position.times))) if count > 1 else 1.0
    if not count:
        return interval, 1.0
    some = np.unique(np.linspace(0, count - 1, min(count, 1000)).astype(int)).tolist()
    variances = [np.diagonal(noise_covariance(position.noise(k), 3)).mean() for k in some]
    return interval if interval > 0.0 else 1.0, float(np.sqrt(np.median(variances)))
