"""Linear motion while no body with Coulomb friction changes between slip and stick.

Such a *mode* gives every body +1 (slips forward), -1 (slips backward) or 0 (sticks). In one mode the system
is linear; with a piecewise linear input a step is one product with a matrix exponential (first-order hold).
A *guard* is a linear function of the state that turns negative when the mode ends: the velocity of a slipping
body, the friction force that a sticking one has in reserve.

Time counts in steps here and velocities are per step, so that all matrices are dimensionless.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.numerics.matrix_exponential import matrix_exponential
from modelgen.runtime.stick_slip.root_finding import when_negative

Mode = tuple[int, ...]

# From so many states on products of matrices cost more than passes over the samples: groups of 2^5 steps.
MANY_STATES, GROUPED = 40, 5


@dataclass(frozen=True)
class CoulombBody:
    """A body with Coulomb friction: row of its velocity in x, inertia, and friction force each way (SI)."""

    velocity: int
    inertia: float
    plus: float
    minus: float


@dataclass(frozen=True, eq=False)
class CubicForce:
    """Adds push (deflection . x)^3 to x'; both have the shape of x, `deflection` is of positions only."""

    deflection: FloatArray
    push: FloatArray


@dataclass(frozen=True, eq=False)
class FrictionSystem:
    """x' = A(mode) x + B w + drift - Coulomb friction / inertia + springs.

    x is n positions, their n velocities, then lags.

    Parameters
    ----------
    matrix : callable
        Mode to A, shape (2n, 2n). It may depend on a body's direction only in the coefficient of that body's
        velocity in its own row (viscous friction to ground).
    B : ndarray, shape (2n, m)
        Input matrix; its rows of positions are zero.
    drift : ndarray, shape (2n,)
        Constant part of x': constant forces over inertias.
    bodies : tuple of CoulombBody
        May be empty.
    lags : int
        Number of states after positions and velocities: forces that follow a command late.
    springs : tuple of CubicForce
        Forces of springs that harden or soften, added to x'.
    """

    matrix: Callable[[Mode], FloatArray]
    B: FloatArray
    drift: FloatArray
    bodies: tuple[CoulombBody, ...]
    lags: int = 0
    springs: tuple[CubicForce, ...] = ()

    def scale(self, step_s: float) -> FloatArray:
        """Return what turns x from SI to time units of steps, shape of x: velocities become per step."""
        n = (self.drift.size - self.lags) // 2
        return np.concatenate([np.ones(n), np.full(n, step_s), np.ones(self.lags)])

    @cached_property
    def both_ways(self) -> tuple[FloatArray, FloatArray]:
        """A, shape (2n + lags, 2n + lags), while all bodies slip forward, and backward.

        That of any other mode is composed of these two.
        """
        forward, backward = ((sign,) * len(self.bodies) for sign in (1, -1))
        return self.matrix(forward), self.matrix(backward)


class ModeMotion:
    """z' = M z in one mode, z = (x, w, slope of w, 1), with the guards of that mode.

    A sticking body is held exactly: its velocity stays 0.0 and its position does not drift.

    Parameters
    ----------
    system : FrictionSystem
        The system in time units of steps.
    mode : tuple of int
        +1, -1 or 0 for every body.

    Attributes
    ----------
    M, step : ndarray, shape (len(z), len(z))
        z' = M z, and the first rows of exp(M), those of x.
    guards, rates : ndarray, shape (guards, len(z))
        The guards and their rates of change; `owners` names body and direction of each.
    free : ndarray, shape (bodies, len(z))
        Accelerations of the bodies without Coulomb friction, whatever the mode.
    """

    def __init__(self, system: FrictionSystem, mode: Mode) -> None:
        self.mode = mode
        self._bodies, self._springs = system.bodies, system.springs
        nx, m = system.B.shape
        self._nx, self._m = nx, m
        velocities = [body.velocity for body in system.bodies]
        self.M = M = np.zeros((nx + 2 * m + 1,) * 2)
        M[:nx, :nx], M[:nx, nx : nx + m], M[:nx, -1] = system.matrix(mode), system.B, system.drift
        self.free = M[velocities]
        for body, sign in zip(system.bodies, mode, strict=True):
            M[body.velocity, -1] -= max(sign, 0) * body.plus / body.inertia
            M[body.velocity, -1] -= min(sign, 0) * body.minus / body.inertia
        for velocity, sign in zip(velocities, mode, strict=True):
            if sign == 0:
                M[velocity] = M[:, velocity] = 0.0
        M[nx : nx + m, nx + m : nx + 2 * m] = np.eye(m)
        self.guards, self.owners = self._make_guards()
        self.rates = self.guards @ M
        self._discretise()

    def _make_guards(self) -> tuple[FloatArray, list[tuple[int, int]]]:
        """Return the guards, shape (guards, len(z)), and of each the body and direction that it watches."""
        owners = [(j, way) for j, sign in enumerate(self.mode) for way in ((sign,) if sign else (1, -1))]
        guards = np.zeros((len(owners), len(self.M)))
        for guard, (j, way) in zip(guards, owners, strict=True):
            body = self._bodies[j]
            if self.mode[j]:
                guard[body.velocity] = way
            else:
                guard[-1] = (body.plus if way > 0 else body.minus) / body.inertia
                guard -= way * self.free[j]
        return guards, owners

    def _discretise(self) -> None:
        """First-order hold: x[k+1] = Phi x[k] + G0 w[k] + G1 w[k+1] + constant."""
        nx, m = self._nx, self._m
        self.step = step = matrix_exponential(self.M)[:nx]
        self._powers = [np.ascontiguousarray(step[:, :nx].T)]
        self._G1 = step[:, nx + m : nx + 2 * m].T
        self._G0 = step[:, nx : nx + m].T - self._G1
        self._constant = step[:, -1]

    def advance(self, x: FloatArray, w: FloatArray) -> tuple[FloatArray, int]:
        """Return the states after each step, shape (steps, 2n), and how many steps come before an event.

        The recursion runs as a scan: pass s adds what happened 2^s steps earlier, so that log2(steps) matrix
        products replace a loop over the steps. Of many states only the ends of groups of 2^GROUPED steps are
        scanned: within the groups a loop takes two products a step. `x` is the state before, shape (2n,); `w`
        has shape (steps + 1, m).
        """
        with np.errstate(over="ignore", invalid="ignore"):
            path = w[:-1] @ self._G0 + w[1:] @ self._G1 + self._constant
            path[0] += x @ self._power(0)
            if len(x) < MANY_STATES:
                self._scan(path, 0)
            else:
                size = 1 << GROUPED
                # place k of each group
                for k in range(1, size):
                    path[k::size] += path[k - 1 :: size][: len(path[k::size])] @ self._power(0)
                ends = path[size - 1 :: size]
                self._scan(ends, GROUPED)
                before = ends
                for k in range(size - 1):
                    before = before @ self._power(0)
                    later = path[size + k :: size]
                    later += before[: len(later)]
            return path, self._calm_steps(np.vstack((x, path)), w)

    def _scan(self, path: FloatArray, s: int) -> None:
        """Add to states that are 2^s steps apart, shape (n, 2n), what the ones before them become."""
        shift = 1
        while shift < len(path):
            path[shift:] += path[:-shift] @ self._power(s)
            shift, s = 2 * shift, s + 1

    def _power(self, s: int) -> FloatArray:
        """Return what takes states 2^s steps on, shape (2n, 2n)."""
        while s >= len(self._powers):
            self._powers.append(self._powers[-1] @ self._powers[-1])
        return self._powers[s]

    def _calm_steps(self, x: FloatArray, w: FloatArray) -> int:
        """Count the steps before the first one within which a guard may turn negative.

        It is negative at the step's end, or may dip below zero inside: it falls first, rises at the end,
        and one of the two tangents gets below zero.
        """
        nx, m = self._nx, self._m
        nodes = np.c_[x, w]
        by_slope = np.diff(w, axis=0) @ self.rates[:, nx + m : -1].T
        values = nodes @ self.guards[:, : nx + m].T + self.guards[:, -1]
        rates = nodes @ self.rates[:, : nx + m].T + self.rates[:, -1]
        falling, rising = rates[:-1] + by_slope, rates[1:] + by_slope
        low = np.minimum(values[:-1] + falling, values[1:] - rising) < 0.0
        dips = (falling < 0.0) & (rising > 0.0) & low
        suspect = ((values[1:] < 0.0) | dips).any(axis=1)
        return int(suspect.argmax()) if suspect.any() else len(suspect)

    def first_event(self, series: FloatArray, released: tuple[int, ...]) -> tuple[float, int | None]:
        """Return the first moment u in [0, 1] at which a guard turns negative, and the guard's index.

        `series` is the power series of z, shape (orders, len(z)), lowest order first. Without an event the
        result is (1.0, None). The acceleration of a body that has just been released is exactly zero.
        """
        first: tuple[float, int | None] = (1.0, None)
        for i, polynomial in enumerate((series @ self.guards.T).T):
            if self.owners[i][0] in released:
                polynomial[1] = 0.0
            u = when_negative(polynomial.tolist())
            if u <= 1.0 and (u < first[0] or first[1] is None):
                first = (u, i)
        return first

    def after(self, guard: int, z: FloatArray) -> tuple[int, int]:
        """Return the body whose mode ends with this guard, and its next mode; `z` has the shape (len(M),)."""
        body, sign = self.owners[guard]
        if self.mode[body] == 0:
            return body, sign
        follow = self.mode_at_rest(body, z)
        # its velocity has just left this direction: only rounding could send it back there
        return body, 0 if follow == sign else follow

    def mode_at_rest(self, body: int, z: FloatArray) -> int:
        """Return the mode of a body at rest, decided by the net force on it; `z` has the shape (len(M),)."""
        pull = float(self.free[body] @ z)
        for spring in self._springs:
            pull += spring.push[self._bodies[body].velocity] * float(spring.deflection @ z[: self._nx]) ** 3
        force = pull * self._bodies[body].inertia
        return int(force > self._bodies[body].plus) - int(force < -self._bodies[body].minus)
