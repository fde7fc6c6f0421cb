"""A public record (EMPS, one carriage) by what a user would take otherwise; see `peers_two_bodies`.

Position in m and force in N at 1 kHz. A rigid carriage: force = M q'' + Fv q' + Fc sign(q') + offset.
"""

from __future__ import annotations

import numpy as np

from modelgen.runtime.records.record import Record

Found = dict[str, tuple[float, float]]
NAMES = ("M", "Fv", "Fc", "offset")


def _filtered(record: Record) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return position, velocity, acceleration and force as the published recipe filters them."""
    from scipy.signal import butter, filtfilt

    b, a = butter(4, 100.0, fs=record.fs)
    q = filtfilt(b, a, record.signals["q_m"])
    v = np.gradient(q, 1.0 / record.fs)
    return q, v, np.gradient(v, 1.0 / record.fs), record.signals["F"]


def statsmodels_rows(record: Record) -> Found:
    """The published recipe with scipy.signal and statsmodels' OLS."""
    import statsmodels.api as sm
    from scipy.signal import decimate

    _, v, a, force = _filtered(record)
    columns = np.column_stack([a, v, np.sign(v), np.ones(record.n)])[49:]
    W = np.column_stack([decimate(column, 10, zero_phase=True) for column in columns.T])
    fit = sm.OLS(decimate(force[49:], 10, zero_phase=True), W).fit()
    return {name: (fit.params[i], 1.96 * fit.bse[i]) for i, name in enumerate(NAMES)}


def pinocchio_rows(record: Record) -> Found:
    """Pinocchio's regressor for the inertia, friction columns added, numpy's lstsq and eq. (11)."""
    import pinocchio as pin
    from scipy.signal import decimate

    robot = pin.Model()
    joint = robot.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "carriage")
    robot.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    data = robot.createData()
    q, v, a, force = _filtered(record)
    mass = [
        pin.computeJointTorqueRegressor(robot, data, q[k : k + 1], v[k : k + 1], a[k : k + 1]).flat[0]
        for k in range(record.n)
    ]
    columns = np.column_stack([mass, v, np.sign(v), np.ones(record.n)])[49:]
    W = np.column_stack([decimate(column, 10, zero_phase=True) for column in columns.T])
    Y = decimate(force[49:], 10, zero_phase=True)
    x, left = np.linalg.lstsq(W, Y, rcond=None)[:2]
    half = 1.96 * np.sqrt(float(left[0]) / (len(Y) - 4) * np.diag(np.linalg.inv(W.T @ W)))
    return {name: (x[i], half[i]) for i, name in enumerate(NAMES)}


def scipy_output_error(record: Record) -> Found:
    """Simulate stretches of 0.5 s from measured states, the direction as measured; least_squares."""
    from scipy.optimize import least_squares
    from scipy.signal import lfilter

    _, v, _, force = _filtered(record)
    n, dt = 500, 1.0 / record.fs
    starts = [k for k in range(0, record.n - n, n) if np.all(v[k : k + n] * v[k] > 0.0)]
    F, y, s = (np.array([part[k : k + n] for k in starts]) for part in (force, v, np.sign(v)))
    scale = np.array([100.0, 200.0, 20.0, -3.0])

    def error(p: np.ndarray) -> np.ndarray:
        M, Fv, Fc, offset = p * scale
        decay = np.exp(-Fv / M * dt)
        inside = F - Fc * s - offset
        forced = lfilter([0.0, (1.0 - decay) / Fv], [1.0, -decay], inside, axis=1)
        free = decay ** np.arange(n)
        left = y - forced
        return (left - np.outer(left @ free / (free @ free), free)).ravel()

    fit = least_squares(error, np.ones(4))
    variance = 2.0 * fit.cost / (fit.fun.size - 4 - len(starts))
    half = 1.96 * np.sqrt(variance * np.diag(np.linalg.inv(fit.jac.T @ fit.jac))) * np.abs(scale)
    return {name: (fit.x[i] * scale[i], half[i]) for i, name in enumerate(NAMES)}
