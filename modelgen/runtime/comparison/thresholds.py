"""Settings of the other estimators and of the comparison of estimates, with their reasons."""

from __future__ import annotations

# Of the low-pass in front of decimation to the elastic modes.
FILTER_ORDER = 6
# Poles with a larger damping ratio are no modes.
MOST_DAMPED = 0.95
# Kept samples a period of the highest wanted mode, and length of the impulse response in samples.
SAMPLES_A_PERIOD = 3.0
# Order beyond that of the elastic modes: rigid motion, delay and noise want states, too.
EXTRA_ORDER = 4
MARKOV = 80

# What is known of a parameter before the first sample, in shares of its start; and of the velocities.
PARAMETER_STD = 0.1
VELOCITY_STD = 0.02
# Passes over the records, at most.
PASSES = 8
# Parameters rest when none moves by more than this share of its deviation.
SETTLED = 0.05
# Least noise of a channel (SI).
LEAST_NOISE = 1e-12

# Central differences by the parameters, in shares of their size.
RELATIVE_STEP = 1e-5
# A velocity within so many of its standard deviations of zero may have either sign.
UNCERTAIN = 3.0

# Modes are looked for up to this multiple of the highest frequency of the estimate.
HIGHEST_MODE = 1.6

# Below this probability of a larger difference by chance, two estimates contradict one another.
SIGNIFICANCE = 0.05
# The response to an impulse is followed over this many periods of the cut-off, either way.
RESPONSE_PERIODS = 40.0
