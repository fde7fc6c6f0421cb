"""Settings of simulations in open loop and of predictions, with their reasons."""

from __future__ import annotations

# Rounds of the search for the state at the beginning; it ends when the error falls by less than this share.
ROUNDS, SETTLED = 6, 1e-4
# Steps of the state for its slopes, in shares of how far each mode moves.
STEP = 1e-3

# Forces that drive what the model does not explain, in shares of the measured force.
DISTURBANCES = (1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1, 1.0)
# On so many samples of the record, which the state at its beginning is found from, too.
JUDGED_SAMPLES = 2000
# A stationary filter exists with so little less memory than a chain that turns freely has.
FADING = 1.0 - 1e-5
# Least noise of a sensor, in shares of its standard deviation: rounding of a simulated one.
LEAST_NOISE = 1e-6
# Noise is what a filter at this share of the sampling frequency leaves over.
NOISE_SHARE = 0.25
FILTER_ORDER = 4
