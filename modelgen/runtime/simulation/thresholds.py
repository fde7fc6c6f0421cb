"""What loops, excitations and comparisons are like unless stated otherwise, with the reasons."""

from __future__ import annotations

# The loop is this part of the lowest elastic frequency, so that it does not see the elasticity ...
BANDWIDTH_RATIO = 0.2
LOWEST_BANDWIDTH_HZ = 1.0
# ... and this where there is none.
RIGID_BANDWIDTH_HZ = 5.0
# Of the closed loop: quick, and without much overshoot.
DAMPING_RATIO = 0.7

# Force of the chirp, in multiples of all Coulomb friction; or the acceleration it gives where there is none.
FORCE_OVER_COULOMB = 10.0
FREE_ACCELERATION = {"N m": 1000.0, "N": 5.0}  # rad/s^2, m/s^2
# The constant velocity under the chirp, in multiples of the largest oscillation of any body.
REVERSAL_MARGIN = 1.5
# Band of the chirp around the elastic modes, and its end where fs is low.
BAND = (0.2, 1.8)
# As a share of the sampling frequency.
HIGHEST_PART_OF_FS = 0.2
# Levels of the trapezoid, in shares of the top speed: two of them distinguish viscous and Coulomb friction.
SPEED_LEVELS = (1.0, 0.5)

# Internal steps.
MOST_STEPS = 5e7  # of a simulation: three hours at 5 kHz
# A drive needs that long to come to rest and stick.
SHORTEST_DWELL_S = 0.04
# The chirp fades in and out over this part of the sweep.
FADE = 0.05

# Linear pieces between samples: what the motion lacks of a sine of f Hz is (pi f / rate)^2 / 3 of it, so that
# too few of them would look like a wrong force.
PIECES_A_SAMPLE = 16
# Ramps between speeds, in periods of the loop's bandwidth.
RAMP_PERIODS = 1.5
# and by which factors they vary with the step.
RAMP_RANGE = (0.5, 2.0)

# Rounds of clipping, by which the crest of a multisine falls.
CREST_ROUNDS = 200
# Clipping comes closer to the peak as the crest falls.
CLIPS = (0.75, 0.98)
# Points a period of the highest sine, so that no peak lies between them.
POINTS_A_WAVE = 16

# Of the low-pass in front of the derivatives that are compared.
FILTER_ORDER = 4
# Cut-off of the derivatives as a share of the sampling frequency, unless it is given.
CUTOFF_SHARE = 0.1
# What lies within the filter's reach of a record's ends is not compared; the filter's response ends where
# it is below this share.
REACH_TOLERANCE = 1e-3
# Internal steps per sample of a continuous controller.
STEPS_A_SAMPLE = 8

# An inertia stays above this share of the largest one of its unit: a plant without inertia cannot be run.
LEAST_INERTIA = 1e-6

# The chain is held by a feedback of this share of its lowest elastic frequency, or of the highest in the
# record: any will do, as rows do not feel it.
HOLDING_SHARE = 0.1

# Of a chain that is smoothed: every body is pushed by at least this share of what friction pushes the first
# one by, as power; a sensor has at least this share of its power as noise, at every frequency, since no model
# is exact; and noise of drifting sensors rises with this power of the frequency below the lowest one.
ELSEWHERE, LEAST_NOISE, SCREENED_ORDER = 1e-4, 1e-9, 4
# The size of pushes is the most likely one of so many, judged at so many frequencies, from a share of noise
# on; so many complex numbers are worked out at once.
PUSHES_TRIED, SEEN_FREQUENCIES, UNSEEN_PUSH, NUMBERS_AT_ONCE = 61, 1000, 1e-3, 200_000
