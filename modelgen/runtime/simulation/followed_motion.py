"""Motion of a body without a sensor that bodies of known motion carry along through the links.

What moves the known bodies, a force or friction that nobody knows, is no matter: their motion holds it.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.filters.power_spectrum import quick_length
from modelgen.runtime.simulation.plant import Plant
from modelgen.runtime.simulation.thresholds import CLOSING_SHARE, LEAST_FOLLOWING_RATIO


def followed_motion(plant: Plant, body: str, known: Mapping[str, FloatArray], dt: float) -> FloatArray:
    """Return how a body moves where others do so and no force is on it or on what lies between.

    Parameters
    ----------
    plant : Plant
        Coulomb friction is left out.
    body : str
    known : mapping of str to array, shape (n,)
        Positions of other bodies, or velocities of all of them, SI.
    dt : float
        Sampling period in s.

    Returns
    -------
    array, shape (n,)
        Of the same kind as `known`.
    """
    bodies, n = plant.bodies, len(plant.bodies)
    led = [bodies.index(one) for one in known]
    free = [place for place in range(n) if place not in led]
    A = np.asarray(plant.space(tuple(1 for _ in plant.sticking)).A)
    springs, dampers = A[n:, :n], A[n:, n : 2 * n]
    h = len(free)
    within = np.ix_(free, free)
    alone = np.block([[np.zeros((h, h)), np.eye(h)], [springs[within], dampers[within]]])
    if not np.all(np.isfinite(alone)):  # stiff beyond all numbers
        return np.zeros(len(next(iter(known.values()))))
    rates, vectors = np.linalg.eig(alone)
    # what nothing damps would ring from one end of the record to the other
    least, size = LEAST_FOLLOWING_RATIO, np.abs(rates)
    damped = size * (-least + 1j * np.sign(rates.imag) * np.sqrt(1.0 - least**2))
    rates = np.where(rates.real > -least * size, damped, rates)
    # two alike poles have one vector: what nothing holds, nor damps
    entering = np.linalg.pinv(vectors)[:, h:]
    shown = vectors[free.index(bodies.index(body))]
    across = np.ix_(free, led)
    pushed, dragged = (shown[:, None] * (entering @ part[across]) for part in (springs, dampers))
    X = np.array([_closed(one) for one in known.values()])
    whole = X.shape[1]
    s = 2j * pi * np.fft.rfftfreq(whole, dt)
    spectra = np.fft.rfft(X)
    found = np.zeros(spectra.shape[1], dtype=complex)
    for rate, spring, damper in zip(rates, pushed, dragged, strict=True):
        swing = s - rate
        # a body that nothing holds has no answer to a constant
        answer = np.divide(1.0, swing, out=np.zeros_like(swing), where=swing != 0.0)
        found += answer * (spring @ spectra + s * (damper @ spectra))
    return np.asarray(np.fft.irfft(found, whole)[: len(next(iter(known.values())))])


def _closed(x: FloatArray) -> FloatArray:
    """Return a signal that leads back to its beginning: a Fourier transform takes it for periodic."""
    more = quick_length(len(x) + max(int(CLOSING_SHARE * len(x)), 1)) - len(x)
    return np.concatenate([x, np.linspace(x[-1], x[0], more + 2)[1:-1]])
