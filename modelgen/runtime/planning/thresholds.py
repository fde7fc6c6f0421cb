"""Limits of predictions and of the search for excitations, with their reasons."""

from __future__ import annotations

# The adjoint is applied to this many samples beyond the record's ends.
BEYOND = 64

# A parameter that fewer of the estimates give counts as not to be had.
GIVEN_SHARE = 0.5

# Share of the variables that a trial changes: most improvements concern one thing.
CHANGED = 0.2
# A part of the motion lasts at least this share of the record, and has this share of the largest force.
SHORTEST_PART = 0.05
LEAST_FORCE = 0.02
# The highest frequency of an excitation, as a share of the sampling frequency.
HIGHEST_PART_OF_FS = 0.2
# Rounds in which speed and force are scaled to their limits, and of shrinking where both depend on each
# other.
SCALINGS = 4
MOST_SHRINKS = 20
# The criterion's logarithm where an experiment fails, or leaves a parameter open.
FAILED = 50.0
# The same of a trajectory along which columns cannot be distinguished: better than one that leaves its boxes.
BLIND = 25.0
# The scale of a trial is met to this share below the limit.
SAFETY = 0.999

# Noisy copies of the experiment that the default of `identify` is run on: its stated deviations differ by
# some 8 % from one to the next.
COPIES = 3

# Noisy copies of the experiment, from whose estimates the weights of composites follow: some at first, then
# twice as many until the factor that they give is known well enough, or as many at most ...
FIRST_COPIES = 16
# ... and no more than a few where these leave more than this share of the parameters open.
FEW_COPIES, OPEN_SHARE = 4, 0.75
# They need no list from which uncertain parameters are removed: a relative deviation in % that none has.
UNPRUNED = 1e9
WEIGHING = 64
FACTOR_ERROR = 0.05

# Exciting trajectories of arms: postures among which one that keeps the boxes is looked for; the share of
# its limits that a first trial has, on the scale of a logistic function (0.88); how often it is made smaller
# until boxes are kept.
POSTURES = 2000
SHARE_OF_LIMITS = 2.0
SHRINKS = 24

# The fast stage of an elastic arm: from so much of its lowest mode to so much of its highest,
BELOW_MODES, BEYOND_MODES = 0.5, 1.25
# within this share of a joint's range, and of its largest speed and acceleration.
FAST_RANGE, FAST_SHARE = 0.05, 0.95
# Harmonics of a series, at most: samples that bound it are many times as many.
MOST_HARMONICS = 2000
