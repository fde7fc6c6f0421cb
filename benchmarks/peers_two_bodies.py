"""Two bodies behind a spring by what a user would take otherwise: each function is what he has to write.

Every one takes the records (q_m, q_c in rad, T in N m, at fs Hz, a chirp and a trapezoid) and a guess, 30 %
off, and returns value and half of the 95 % interval by name; NaN where the program gives no interval.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from modelgen.runtime.records.record import Record

Found = dict[str, tuple[float, float]]
NAMES = ("J_m", "F_vm", "F_sm", "J_c", "K", "D")


def scipy_output_error(records: Sequence[Record], guess: Mapping[str, float]) -> Found:
    """Simulate stretches of 0.1 s, any initial state, friction by the measured direction; least_squares."""
    from scipy.linalg import toeplitz
    from scipy.optimize import least_squares
    from scipy.signal import butter, sosfiltfilt
    from scipy.signal import cont2discrete as sampled

    fs, n = records[0].fs, int(0.1 * records[0].fs)
    low = butter(2, 100.0, output="sos", fs=fs)
    forces, readings = [], []
    for one in records:
        sign = np.sign(np.gradient(sosfiltfilt(low, one.signals["q_m"]), 1.0 / fs))
        for start in range(0, one.n - n + 1, n):
            part = slice(start, start + n)
            if np.all(sign[part] == sign[start]):  # a reversal within a stretch is not where the sign says
                forces.append(np.column_stack([one.signals["T"], sign])[part])
                readings.append(np.column_stack([one.signals["q_m"], one.signals["q_c"]])[part])
    u, y = np.array(forces), np.array(readings)
    y = y - y[:, :1, :1]
    scale = np.array([guess[name] for name in NAMES])

    def error(p: np.ndarray) -> np.ndarray:
        jm, fv, fs_m, jc, k, d = p * scale
        A = np.array([[0, 1, 0, 0], [-k / jm, -(fv + d) / jm, k / jm, d / jm],
                      [0, 0, 0, 1], [k / jc, d / jc, -k / jc, -d / jc]])  # fmt: skip
        B = np.array([[0, 0], [1 / jm, -fs_m / jm], [0, 0], [0, 0]])
        C = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0]])
        A, B, C, D, _ = sampled((A, B, C, np.zeros((2, 2))), 1.0 / fs, method="foh")
        free = [C]
        for _ in range(n - 1):
            free.append(free[-1] @ A)
        impulse = np.concatenate([D[None], np.array(free[:-1]) @ B])
        forced = sum(
            np.stack([u[:, :, i] @ toeplitz(impulse[:, o, i], np.zeros(n)).T for o in range(2)], axis=2)
            for i in range(2)
        )
        left = (y - forced).reshape(len(y), -1).T
        states = np.array(free).reshape(-1, 4)
        return (left - states @ np.linalg.lstsq(states, left, rcond=None)[0]).ravel() / np.std(y) * 1e3

    fit = least_squares(error, np.ones(6), x_scale="jac")
    variance = 2.0 * fit.cost / (fit.fun.size - 6 - 4 * len(y))
    half = 1.96 * np.sqrt(variance * np.diag(np.linalg.inv(fit.jac.T @ fit.jac))) * scale
    return {name: (fit.x[i] * scale[i], half[i]) for i, name in enumerate(NAMES)}


def statsmodels_rows(records: Sequence[Record], guess: Mapping[str, float]) -> Found:
    """Write down the rows, filter with scipy.signal, solve with statsmodels and its HAC covariance."""
    import statsmodels.api as sm
    from scipy.ndimage import minimum_filter1d
    from scipy.signal import butter, decimate, sosfiltfilt

    del guess
    W, Y = [], []
    for one in records:
        low = butter(4, 250.0, output="sos", fs=one.fs)
        qm, qc, T = (sosfiltfilt(low, one.signals[key]) for key in ("q_m", "q_c", "T"))
        vm, vc = np.gradient(qm, 1 / one.fs), np.gradient(qc, 1 / one.fs)
        am, ac = np.gradient(vm, 1 / one.fs), np.gradient(vc, 1 / one.fs)
        zero, sign = np.zeros(one.n), sosfiltfilt(low, np.sign(vm))
        # where the direction changes within the filter's reach, its sign is not what acts
        sure = minimum_filter1d(np.abs(vm), 101)[::8][50:-50] > 0.02 * np.max(np.abs(vm))
        for row, y in (((am, vm, sign, ac, zero, zero), T), ((zero, zero, zero, ac, qc - qm, vc - vm), zero)):
            W.append([decimate(column, 8, zero_phase=True)[50:-50][sure] for column in row])
            Y.append(decimate(y, 8, zero_phase=True)[50:-50][sure])
    rows, y = np.concatenate([np.array(part).T for part in W]), np.concatenate(Y)
    which = np.repeat(np.arange(len(Y)), [len(part) for part in Y])
    weights = np.ones(len(y))
    for _ in range(3):  # weights from the residuals of each row
        fit = sm.WLS(y, rows, weights=weights).fit()
        weights = np.array([1.0 / np.var(fit.resid[which == k]) for k in range(len(Y))])[which]
    fit = sm.WLS(y, rows, weights=weights).fit(cov_type="HAC", cov_kwds={"maxlags": 20})
    return {name: (fit.params[i], 1.96 * fit.bse[i]) for i, name in enumerate(NAMES)}


def mujoco_sysid(records: Sequence[Record], guess: Mapping[str, float]) -> Found:
    """Describe the machine in MJCF and fit its simulation with mujoco.sysid."""
    import mujoco
    import mujoco.sysid as sysid
    from scipy.signal import butter, sosfiltfilt

    xml = f"""<mujoco><option timestep="{1.0 / records[0].fs!r}" gravity="0 0 0" integrator="implicitfast"/>
    <worldbody>
      <body name="m"><joint name="m" axis="0 0 1" armature="1"/>
        <inertial pos="0 0 0" mass="1e-6" diaginertia="1e-9 1e-9 1e-9"/></body>
      <body name="c"><joint name="c" axis="0 0 1" armature="1"/>
        <inertial pos="0 0 0" mass="1e-6" diaginertia="1e-9 1e-9 1e-9"/></body>
    </worldbody>
    <tendon><fixed name="k" springlength="0"><joint joint="m" coef="1"/><joint joint="c" coef="-1"/></fixed>
    </tendon>
    <actuator><motor name="T" joint="m"/></actuator>
    <sensor><jointpos name="q_m" joint="m"/><jointpos name="q_c" joint="c"/></sensor></mujoco>"""

    def joint(name: str, field: str):
        return lambda spec, p: setattr(spec.joint(name), field, _like(spec.joint(name), field, p.value[0]))

    def tendon(field: str):
        return lambda spec, p: setattr(spec.tendon("k"), field, _like(spec.tendon("k"), field, p.value[0]))

    fields = (joint("m", "armature"), joint("m", "damping"), joint("m", "frictionloss"),
              joint("c", "armature"), tendon("stiffness"), tendon("damping"))  # fmt: skip
    parameters = sysid.ParameterDict()
    for name, modify in zip(NAMES, fields, strict=True):
        value = guess[name]
        parameters[name] = sysid.Parameter(name, value, 0.2 * value, 5.0 * value, modifier=modify)
    model = mujoco.MjSpec.from_string(xml).compile()
    controls, readings, states, low = [], [], [], butter(4, 250.0, output="sos", fs=records[0].fs)
    for one in records:
        q = np.column_stack([one.signals["q_m"], one.signals["q_c"]])
        smooth = sosfiltfilt(low, q, axis=0)
        speed = np.gradient(smooth, 1.0 / one.fs, axis=0)
        # open loop it drifts: some stretches of 50 ms, each from its measured state
        for start in range(0, one.n - 250 + 1, 1000):
            t = np.arange(250) / one.fs
            part = slice(start, start + 250)
            states.append(sysid.create_initial_state(model, smooth[start], speed[start]))
            controls.append(sysid.TimeSeries(t, one.signals["T"][part, None]))
            readings.append(sysid.TimeSeries.from_names(t, q[part], model))
    names = [f"part {k}" for k in range(len(states))]
    spec = mujoco.MjSpec.from_string(xml)
    sequences = [sysid.ModelSequences("drive", spec, names, states, controls, readings)]
    residual = sysid.build_residual_fn(models_sequences=sequences)
    found, result = sysid.optimize(parameters, residual, verbose=False)
    left = residual(result.x, found)[0]
    half = sysid.calculate_intervals(left, result.jac)[1]
    return {name: (float(result.x[i]), float(np.ravel(half)[i])) for i, name in enumerate(NAMES)}


def _like(thing: object, field: str, value: float) -> object:
    """Return a value in the shape that MuJoCo has for the field: some are polynomials' coefficients."""
    old = np.asarray(getattr(thing, field), dtype=float)
    return value if old.ndim == 0 else np.concatenate([[value], np.zeros(old.size - 1)])


def opty_collocation(records: Sequence[Record], guess: Mapping[str, float]) -> Found:
    """Fit states and parameters at once by direct collocation with opty and Ipopt; half a second of chirp."""
    import sympy as sp
    from opty import Problem

    one = records[0].part(4000, 6500, "about the mode")
    t = sp.Symbol("t")
    qm, vm, qc, vc, T = (sp.Function(name)(t) for name in ("qm", "vm", "qc", "vc", "T"))
    jm, fv, fs_m, jc, k, d = parameters = sp.symbols("J_m F_vm F_sm J_c K D")
    units = [guess[name] for name in NAMES]
    jm, fv, fs_m, jc, k, d = (p * u for p, u in zip(parameters, units, strict=True))
    spring, speed = k * (qm - qc) + d * (vm - vc), 0.01 * float(np.ptp(one.signals["q_m"])) * one.fs / one.n
    equations = sp.Matrix([
        qm.diff(t) - vm,
        (vm.diff(t) * jm + fv * vm + fs_m * sp.tanh(vm / speed) + spring - T) / units[2],
        qc.diff(t) - vc,
        (vc.diff(t) * jc - spring) / units[2],
    ])  # fmt: skip
    n = one.n
    measured = np.concatenate([one.signals["q_m"], one.signals["q_c"]])
    scale = 1.0 / np.var(np.diff(measured))

    def error(free: np.ndarray) -> np.ndarray:
        return np.concatenate([free[:n], free[2 * n : 3 * n]]) - measured

    def objective(free: np.ndarray) -> float:
        return float(scale * np.sum(error(free) ** 2))

    def gradient(free: np.ndarray) -> np.ndarray:
        slope, e = np.zeros_like(free), 2.0 * scale * error(free)
        slope[:n], slope[2 * n : 3 * n] = e[:n], e[n:]
        return slope

    problem = Problem(objective, gradient, equations, (qm, vm, qc, vc), n, 1.0 / one.fs,
                      known_trajectory_map={T: one.signals["T"]}, time_symbol=t,
                      integration_method="midpoint", bounds=dict.fromkeys(parameters, (0.1, 9)))  # fmt: skip
    problem.add_option("print_level", 0)
    problem.add_option("max_iter", 1000)
    states = [one.signals["q_m"], np.gradient(one.signals["q_m"], 1 / one.fs)]
    states += [one.signals["q_c"], np.gradient(one.signals["q_c"], 1 / one.fs)]
    order = [str(p) for p in problem.collocator.unknown_parameters]
    solution, info = problem.solve(np.concatenate([*states, np.ones(6)]))
    values = dict(zip(order, solution[-6:], strict=True))
    if info["status"] < 0:
        raise RuntimeError(str(info["status_msg"]))
    return {name: (values[name] * u, np.nan) for name, u in zip(NAMES, units, strict=True)}


def control_era(records: Sequence[Record], guess: Mapping[str, float]) -> Found:
    """Realize the impulse response with python-control's ERA: a mode's frequency in Hz and damping ratio."""
    import control
    from scipy.signal import butter, sosfiltfilt

    del guess
    one, factor = records[0], 6
    low = butter(6, 0.4 * one.fs / factor, output="sos", fs=one.fs)
    force, *motion = (sosfiltfilt(low, one.signals[key]) for key in ("T", "q_m", "q_c"))
    # accelerations: their response to an impulse decays in spite of the free motion
    outputs = [np.gradient(np.gradient(q, 1.0 / one.fs), 1.0 / one.fs)[::factor] for q in motion]
    scaled = np.array([y / np.std(y) for y in outputs])
    dt = factor / one.fs
    data = control.TimeResponseData(
        np.arange(scaled.shape[1]) * dt, scaled, inputs=force[None, ::factor], issiso=False
    )
    impulse = control.markov(data, 80, dt=dt, truncate=True)
    system = control.eigensys_realization(impulse, 6, dt=dt)[0]
    poles = np.log(system.poles().astype(complex)) / dt
    modes = [p for p in poles if p.imag > 0.0 and 0.0 < -p.real < 0.9 * abs(p)]
    lowest = min(modes, key=abs)
    return {"f_1": (abs(lowest) / 2 / np.pi, np.nan), "zeta_1": (-lowest.real / abs(lowest), np.nan)}
