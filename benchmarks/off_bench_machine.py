"""A drive train simulated on its own, without modelgen: what modelgen is judged by must not share its faults.

Bodies and links with viscous and Coulomb friction, stick and slip, and what models leave out: backlash,
stiffening, Stribeck friction, ripple. Leapfrog steps (Hairer, Lubich, Wanner 2003), damping implicit, Coulomb
friction as a bounded impulse, so that a body sticks until the force exceeds its friction.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
# Steps a sample: leapfrog takes a stiffness for (w h)^2 / 12 larger than it is, w its frequency: 8e-7, 5 kHz.
FINE = 64
SWEEPS = 3
# Of rubber, belts and gears: Maxwell's elements beside the spring.
CREEPS_HZ = np.array([0.5, 5.0, 50.0])


@dataclass(frozen=True)
class Machine:
    """Bodies (n) and links (m), SI; `first`, `second` are the bodies of a link, -1 is the ground.

    A deflection is q_first / ratio - q_second; the motor is body 0.
    """

    inertia: tuple[float, ...]
    viscous: tuple[float, ...]
    coulomb: tuple[float, ...]
    first: tuple[int, ...]
    second: tuple[int, ...]
    stiffness: tuple[float, ...]
    damping: tuple[float, ...]
    ratio: tuple[float, ...] = (1.0, 1.0, 1.0)
    offset: float = 0.0  # constant force on the motor
    backlash: float = 0.0  # full width, first link
    cubic: float = 0.0  # of the first link, per rad^2 of stiffness
    stribeck: float = 0.0  # static friction over Coulomb friction, minus 1
    stribeck_speed: float = 1.0
    quadratic: float = 0.0  # force per squared speed, motor
    asymmetry: float = 0.0  # Coulomb friction of the motor, forward over mean minus 1
    ripple: float = 0.0  # force over Coulomb friction, 12 periods a turn
    creep: float = 0.0  # share of the first link's stiffness that creeps at each of `CREEPS_HZ`
    bristle: float = 0.0  # stiffness of presliding over Coulomb friction, 1 / rad (Dahl 1968)

    @property
    def referred(self) -> float:
        """Inertia at the motor."""
        total, place = self.inertia[0], {0: 1.0}
        for a, b, ratio in zip(self.first, self.second, self.ratio, strict=False):
            if b > 0:
                place[b] = place[a] / ratio
                total += self.inertia[b] * place[b] ** 2
        return total

    @property
    def frequency(self) -> float:
        """Lowest elastic natural frequency in rad/s."""
        n = len(self.inertia)
        K = np.zeros((n, n))
        for a, b, ratio, k in zip(self.first, self.second, self.ratio, self.stiffness, strict=False):
            row = np.zeros(n)
            row[a] = 1.0 / ratio
            if b >= 0:
                row[b] = -1.0
            K += k * np.outer(row, row)
        values = np.linalg.eigvals(K / np.array(self.inertia)[:, None]).real
        return float(np.sqrt(min(v for v in values if v > 1e-6 * max(values))))


@dataclass(frozen=True)
class Motion:
    """On the fine grid, from t = 0: positions and speeds, shape (n, bodies), force, shape (n,)."""

    step: float
    position: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    force: FloatArray
    command: FloatArray


@dataclass(frozen=True)
class Command:
    """Reference of the motor and injected force on the fine grid, shape (n,) each."""

    position: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    force: FloatArray


@dataclass(frozen=True)
class LoopOptions:
    """`lag_s` of the current loop; `held`: it changes once a sample; `noise` of its reading."""

    lag_s: float = 0.0
    held: bool = False
    noise: FloatArray = field(default_factory=lambda: np.zeros(0))


def run(machine: Machine, command: Command, step: float, loop: LoopOptions, samples: int) -> Motion:
    """Return the motion in closed loop: proportional feedback of position and speed of the motor."""
    rate = machine.frequency / 12.0
    gains = (machine.referred * rate**2, 1.4 * machine.referred * rate)
    noise = loop.noise if loop.noise.size else np.zeros(samples + 2)
    numbers = np.array(
        [machine.offset, machine.backlash, machine.cubic, machine.stribeck, machine.stribeck_speed,
         machine.quadratic, machine.asymmetry, machine.ripple, machine.bristle, machine.creep,
         loop.lag_s, float(loop.held), *gains, machine.referred]
    )  # fmt: skip
    m = len(machine.first)
    q, v, a, force, wanted = _run(
        np.array(machine.inertia), np.array(machine.viscous), np.array(machine.coulomb),
        np.array(machine.first), np.array(machine.second), np.array(machine.stiffness),
        np.array(machine.damping), np.array(machine.ratio[:m]), numbers,
        command.position, command.speed, command.acceleration, command.force, noise, step,
    )  # fmt: skip
    return Motion(step, q, v, a, force, wanted)


@njit(cache=True)
def _run(J, Fv, Fs, first, second, K, D, ratio, numbers, rq, rv, ra, inject, noise, h):  # type: ignore[no-untyped-def]  # pragma: no cover
    offset, backlash, cubic, stribeck, v_s, quadratic, asymmetry, ripple, bristle, creep = numbers[:10]
    lag, held, kp, kd, total = numbers[10:]
    n, m, steps = J.size, K.size, rq.size
    rows = np.zeros((m, n))
    for k in range(m):
        rows[k, first[k]] = 1.0 / ratio[k]
        if second[k] >= 0:
            rows[k, second[k]] = -1.0
    damping = np.diag(Fv.copy())
    for k in range(m):
        damping += D[k] * np.outer(rows[k], rows[k])
    mass = np.diag(J.copy())
    new, old = np.linalg.inv(mass + 0.5 * h * damping), mass - 0.5 * h * damping
    q, v = np.zeros(n), np.zeros(n)
    Q, V, A = np.zeros((steps, n)), np.zeros((steps, n)), np.zeros((steps, n))
    U, C = np.zeros(steps), np.zeros(steps)
    q[:] = 0.0
    v[:] = 0.0
    u, command, z, crept = 0.0, 0.0, 0.0, np.zeros(CREEPS_HZ.size)
    for i in range(steps):
        sample = i // FINE
        if held == 0.0 or i % FINE == 0:
            e = noise[sample]
            de = (e - noise[sample - 1]) / (FINE * h) if sample else 0.0
            command = total * ra[i] + kp * (rq[i] - q[0] - e) + kd * (rv[i] - v[0] - de) + inject[i]
        u = command if lag == 0.0 else u + (command - u) * (1.0 - np.exp(-h / lag))
        F = np.zeros(n)
        F[0] = u - offset - quadratic * v[0] * abs(v[0]) - ripple * Fs[0] * np.sin(12.0 * q[0])
        for k in range(m):
            d = np.dot(rows[k], q)
            if k == 0:
                d = (
                    d - 0.5 * backlash
                    if d > 0.5 * backlash
                    else (d + 0.5 * backlash if d < -0.5 * backlash else 0.0)
                )
                f = K[k] * d * (1.0 + cubic * d * d)
                if creep > 0.0:
                    crept += 2.0 * np.pi * h * CREEPS_HZ * (d - crept)
                    f += creep * K[k] * np.sum(d - crept)
            else:
                f = K[k] * d
            F -= f * rows[k]
        if bristle > 0.0:
            F[0] -= Fs[0] * z
        free = new @ (old @ v + h * F)
        impulse = np.zeros(n)
        for _ in range(SWEEPS):
            for b in range(n):
                if Fs[b] == 0.0 or (b == 0 and bristle > 0.0):
                    continue
                limit = Fs[b] * h
                if b == 0:
                    limit *= 1.0 + stribeck * np.exp(-((v[0] / v_s) ** 2))
                    limit *= 1.0 + asymmetry * np.sign(free[0])
                w = free[b]
                for c in range(n):
                    w += new[b, c] * impulse[c]
                p = impulse[b] - w / new[b, b]
                impulse[b] = min(max(p, -limit), limit)
        after = free + new @ impulse
        Q[i], V[i], A[i], U[i], C[i] = q, 0.5 * (v + after), (after - v) / h, u, command
        v = after
        if bristle > 0.0:
            z += h * bristle * (v[0] - abs(v[0]) * z)
        q = q + h * v
    return Q, V, A, U, C
