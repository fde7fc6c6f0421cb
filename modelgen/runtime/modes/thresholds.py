"""Settings of modes and their intervals, with their reasons."""

from __future__ import annotations

# A squared frequency below this share of the largest is that of a chain that turns freely.
RIGID_SHARE = 1e-9
# Vectors of a pair of poles worse conditioned than this are iterated for: rounding grows by as much.
ALONE = 1e3
# Rounds of inverse iteration: each shrinks what is left of other subspaces by some 1e-10.
ROUNDS_OF_ITERATION = 3

# Of a normal distribution: 95 % lie within.
Z95 = 1.959963984540054
# A value whose standard deviation is below this share of it is as good as linear in the parameters there:
# what the delta method leaves out is of the order of the square.
LINEAR_SHARE = 0.03
# Damping ratios so near to 1 (in standard deviations, and as a share) belong to poles that may be real or
# not: their time constants have an infinite slope there, and are worked out at the ends.
NEAR_CRITICAL, CRITICAL_SHARE = 4.0, 0.02
# An inertia is moved by its logarithm, by no more than this.
MOST_LOG = 5.0

# A direction of parameters that come from composites is too uncertain for a linear step if its deviation is
# this share of them; a mode is left open if that is this share of the mode's own deviation, and of its value.
LOOSE_SHARE = 0.2
LOOSE_PART, LOOSE_SIZE = 0.3, 0.005
# Such a direction reaches as far as its reciprocal does, at most by this factor.
FARTHEST = 4.0
# A mode depends on what the records leave open if more than this share of its slope lies there.
OPEN_SHARE = 1e-5
# Open directions are tried out by so much of a parameter's size: a slope may be zero by chance.
TRIED = 0.3
# A parameter with this share of a direction that is open is the direction: nothing is known of it.
FULLY_OPEN = 1.0 - 1e-9

# Motions below this share of the largest one of a shape are rounding.
ROUNDING = 1e-9
# Two real rates nearer than this share of their sum are taken as so far apart, for the direction of a slope.
SHARPEST = 1e-6

# A mode with a larger damping ratio shows no peak to compare with.
PEAK_DAMPING = 0.3
# A peak belongs to a mode within the first factor of its frequency and is the highest line within it; it
# stands out by so much of the lowest lines within the second factor either way (a damping ratio of 0.1 makes
# it that wide), and the force explains at least so much of the reading there.
PEAK_RANGE, VALLEY_RANGE, PEAK_RISE, LEAST_COHERENCE = 1.15, 1.5, 1.5, 0.9
# The force has at least this share of its largest density of power there: less is leakage, or noise.
EXCITED = 0.02
# Records that are looked at, and samples of the longest one.
MOST_PEAK_RECORDS, LONGEST_RECORD = 4, 10_000_000

# Postures along the records of an arm in which its modes are looked for.
MOST_POSTURES = 60
# Springs are stretched by so much (rad or m) to both sides of where they are unloaded.
STRETCHED = 1e-4

# Poles are given to modes by trying all ways where there are no more than this: loading an optimizer for two
# poles takes a tenth of the time of a short identification.
FEW_WAYS = 120
