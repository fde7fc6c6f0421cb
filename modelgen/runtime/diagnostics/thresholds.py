"""When a motion, a sample, a residual or an estimate is reported as wrong: every limit with its reason."""

from __future__ import annotations

from math import sqrt

# A move of more standard deviations of the difference than this is no chance.
SIGNIFICANT_MOVE = 3.0
# Nor does a move below this share of the value count: sampling and filters are not exact beyond it.
SMALLEST_SHARE = 2e-4

# Tried by default: multiples of the cut-off in use, and differences from the order in use.
SCANNED_FACTORS = (0.5, 1.0 / sqrt(2.0), 1.0, sqrt(2.0), 2.0)
ORDER_STEPS = (-2, 2, 4)
# Orders of a filter that are tried, at least and at most.
LOWEST_ORDER, HIGHEST_ORDER = 2, 20

# Preferred when the difference is this many standard deviations: a chance of 1 in 16 000.
SIGNIFICANT_ASYMMETRY = 4.0

# A filtered sign() that goes to the other side by less than this share of itself never saw a reversal.
LEAST_CHANGE = 0.2
# A steady velocity of so many standard deviations of its noise is a motion.
LEAST_SPEED = 3.0
# A record needs so many times the stretch over which its residuals stay correlated,
FEWEST_STRETCHES = 10.0
# so many periods of the slowest mode,
FEWEST_SWINGS = 5.0
# and should not lose more than this share to the filter's reach at both ends.
LARGEST_LOSS = 0.5

# A bias is reported from this share of the value and this many standard deviations of the noise.
LEAST_BIAS, LEAST_DEVIATIONS = 0.01, 2.0
# Where less than this share of a combination of columns is no noise, the bias by it is unknown; a
# parameter is lost that has more than this part of its variance from there.
LEAST_SIGNAL, LOST_PART = 0.1, 0.01
# The power of products of noise is known to this share: lines are bent at readings that hold the noise, and
# what encoders round is not normal. Those of a rounded motor squared came out up to a sixth too small.
PRODUCTS_UNKNOWN = 0.2
# What share of the noise a row leaves is looked at again with what that moves, so often at most, until it
# changes by less than this: by then biases change by less than is kept of them in the intervals.
MOST_SHARES, SAME_SHARE = 10, 0.01
# A parameter with a bias of more than this share of what is left of it is lost, where more than so many
# standard deviations of it are still in the estimate: with half a one, 92 % of 95 % intervals hold.
LOST_SHARE, HARMLESS_BIAS = 1.0, 0.5

# A row without a force that leaves this share of its largest term, or a row that leaves this share of its
# force, explains nothing.
NULL_SHARE = 0.9
# Zero solves a row without a force as well as its parameters do where chance puts them as far from it as they
# are with at least this probability: it lies within the joint 95 % interval.
ZERO_LIKELY = 0.05
# Values lie within the joint 95 % interval if chance puts an estimate as far from them with this probability.
WITHIN_INTERVAL = 0.05
# A residual below this multiple of what noise of the sensors gives its row is noise.
LARGEST_NOISE = 1.5
# One from this multiple on is none, whatever a sensor's noise is like: stick and slip leaves up to four.
NO_NOISE = 6.0
# Friction in vibration counts where it is so many times what the model, beyond noise, leaves of its rows.
FRICTION_OVER_REST = 3.0
# Where what encoders round is so many times the white floors in a row, it has a colour of its own.
MOSTLY_ROUNDED = 1.2
# Friction whose interval holds zero, and at its end less than this share of the force of every row, is none.
NEGLIGIBLE = 5e-3
# Derivatives with less signal than this above their noise bias least squares visibly.
LEAST_SNR_DB = 20.0

# Of more whole periods than so many, several are taken together.
MOST_CLUSTERS = 50
# The spread counts as larger than the noise beyond the bound that chance passes in 1 % of all records.
CONFIDENCE = 0.99

# Past samples of the decimated grid that the residual is correlated with, as MATLAB's resid takes them.
INPUT_LAGS = 25
# A correlation that explains less than this share of the residual's power is not reported, however
# significant it is.
LEAST_EXPLAINED = 0.01
# Of what noise makes residuals follow by itself this share may be left: it is worked out to a fifth.
LEFT_OF_NOISE = 0.2
# What repeats in every period counts from this share of the residual's power.
LEAST_REPEATED = 0.1
# Below this share of the largest term of its row, a residual is what sampling and filters leave undone.
SMALLEST_ERROR = 5e-4

# A residual is tested on its longest stretch without masked samples, of so many frequencies at least, and of
# so many samples at most: more of them would only show that no model is exact.
FEWEST_LINES = 32
MOST_SAMPLES = 1 << 15
# Lags of the whiteness, rounds in which the residual's colour is fitted, and how often one is halved.
WHITENESS_LAGS = 20
WHITENESS_ROUNDS, WHITENESS_HALVINGS = 30, 8
# Series of noise that are drawn to see what rows which leave forces open do to its whiteness.
DRAWS = 40
# What a row leaves bounds noise of its channels in each of so many bands at most, by so many deviations more
# than is found: the least of sixteen bands of 32 lines is about two below the mean.
MOST_BANDS, BOUND_DEVIATIONS = 16, 2.3
# Frequencies at which the filter leaves less than this share of its largest power hold only rounding.
LEAST_POWER = 1e-4

# What encoders round is worked out along records of so many samples at most: in longer ones no few steps of a
# sample stay whole for long.
LONGEST_ROUNDED = 1 << 18

# Cut-offs and weights of load rows that are tried, as multiples of those in use.
CUTOFF_FACTORS = (1.0 / sqrt(2.0), sqrt(2.0))
# Farther cut-offs, once the near ones have shown that the model lacks something
FARTHER_FACTORS = (0.35, 0.5, 2.0)
LOAD_ROW_FACTORS = (0.5, 2.0)
# The cut-off of directions that is tried: a fast vibration shifts the moment at which a low-passed velocity
# changes its sign, and where that matters, this shows it.
DIRECTION_FACTOR = 2.0

# Chance that a run of equal readings as long as one that counts comes about in a record by itself.
CHANCE = 1e-6
SHORTEST_RUN = 8
# So many runs tell how often a reading that was repeated is so again, to a sixth of a share of a half.
MANY_RUNS = 50
# Clipped readings come in runs of at least three; so many runs at the ends of the range, and fewer than this
# share elsewhere, are no chance.
CLIPPED_RUN, OFTEN, RARELY = 3, 4, 0.1
# A force whose reading is clipped is so in no more than this share of the samples, and more than this share
# of the squares of what its row leaves stands there.
CLIPPED_SHARE, LEFT_AT_LIMIT = 0.25, 0.5
# A step before or after a run is one at full speed from this share of the rms step on, if it is also so many
# times the resolution, and so many times the usual change from step to step.
FULL_SPEED, RESOLUTIONS, USUAL_CHANGES = 0.15, 4.0, 4.0
# A ramp that ends in a run (a command, not a limit) bends less than this share of such a step.
STRAIGHT = 1e-6
# Noise changes the sign of its fourth difference nearly every sample; it counts from so many resolutions on.
ALTERNATING, VISIBLE_NOISE = 0.6, 2.0
# A few readings without noise show what rounding leaves, 0.3 of a resolution; those with it two and more.
CALM = 0.75
# Neighbours of white noise that large are equal with this probability, 1 / (2 sqrt(pi) 2); three in a row
# with its square, and so many standard deviations more often than that by no chance.
REPEATED_NOISE, CERTAIN_CHANCE = 0.14, 5.0
# Noise does not show where more than this share of so many readings before and after a run repeat as well.
REPEATED, NEARBY = 0.5, 32
# A sensor that was stuck leaps to where the motion is by then: by this many of the largest usual steps.
LEAP_AFTER_STUCK = {"position": 1.0, "velocity": 5.0}
# A position stands while it moves on where the step behind is so many times those around, longer by so many
# resolutions, and by so many usual changes of its speed (this percentile), as above. At a steady speed one
# reading that is repeated makes the next step twice as long. It is no longer than so many times the way at
# the larger speed.
CAUGHT_UP, LEAST_CAUGHT_UP, USUAL_CHANGE_OF_SPEED, MOST_CAUGHT_UP = 1.5, 4.0, 0.95, 2.0
# A channel with noise repeats a reading by fault from so many equal ones on.
FEWEST_FROZEN = 3
# Forces and accelerations repeat a reading by fault where fewer than this share of the others are repeated,
# and the machine moves during most of the run.
SELDOM, MOSTLY = 0.01, 0.9

# A step unlike its neighbours by this many times a percentile, so many resolutions and this share of the rms
# step is a leap: the first percentile where the position comes back (it may be one of many wrong readings),
# else the second.
LEAP, LEAP_RESOLUTIONS, LEAP_SPEED = 20.0, 6.0, 0.3
USUAL_CHANGES_OF_STEP = (0.95, 0.999)
# Fewer steps than this between the least and the largest reading are too few to differentiate.
FEWEST_STEPS = 50
# A machine's readings do not span more than this.
WIDEST = {"m": 100.0, "m/s": 100.0, "m/s^2": 1e5, "rad/s": 1e5, "rad/s^2": 1e8}
# The machine moves where a sensor's speed, over so many samples before and after, is this share of its rms.
MOVES, AROUND = 0.1, 8
# A mass slows down where it moves by less than this share of what it moved in the time before (a third by a
# steady force); looked at in so many times, each twice as long, until so many deviations of noise are moved.
SLOWER, SPANS, MOVES_CLEARLY = 0.6, 4, 4.0
# Samples over which a force that settles behind a current loop slows down by as much.
SETTLING = (2, 4)
# A sensor goes on as before where it misses its track behind a leap by less than the first share of how far
# wrong readings are off, and its steps there change by less than the second; so many are bridged at most.
BACK_ON_TRACK, BENT, LONGEST_BRIDGED = 0.1, 0.2, 8
# A record is cut at so many leaps at most; its parts are used that have this share of the longest one.
MOST_CUTS, SHORTEST_PART = 8, 0.25
# A leap is looked for between the second and the last but one step of a stretch.
OVERLAP = 3
# Stretches, or leaps, that are listed.
LISTED = 3

# What a chain's own dynamics do not explain: a resonance with 0.5 % damping gives 100.
UNIT_FACTOR = 200.0
# Units that are mistaken for SI by less, where bodies move as one; how near a logarithm of a ratio must be.
# A resonance within a few octaves bends the ratio.
TURNED_UNITS = {
    "rad": {57.29578: "degrees", 6.283185: "revolutions"},
    "rad/s": {57.29578: "degrees", 6.283185: "revolutions", 9.549297: "revolutions per minute"},
    "rad/s^2": {57.29578: "degrees", 6.283185: "revolutions"},
}
UNIT_TOLERANCE = 0.2
# Two bodies move against each other where one moves at most so many times as far as the other.
REVERSED = 2.0
# Values that are off by one factor: within so much of each other. Two or more that are within SAME are off by
# the same: a unit explains that from a smaller factor on.
ALIKE, SAME, SAME_FACTOR = 10.0, 1.5, 10.0
# Bands of a third of an octave in which two sensors move alike; in the lowest of them a chain moves as one.
THIRD_OCTAVE, SMALLEST_BAND, FIRST_BIN = 1.26, 8, 4
COHERENCE, BANDS = 0.9, 3
# The ratio may change so much from band to band; far above a resonance it falls with the frequency.
FLAT = 3.0
# Where it changes by more than this, the bands lie about a resonance or beyond, and say nothing of units.
FALLING = 1.5
# A ratio in the lowest band that is off by so much (of its logarithm) is no sensor's gain and no backlash.
OFF = 0.05
# A position is off by a ratio from so much on (a clock of its own takes 1e-3 of a way), where the way
# explains this share of the difference, this share of it is none of what bends springs; of so many points.
APART, WAY_SHARE, WAY_OF_ITS_OWN, WAY_POINTS = 2e-3, 0.9, 0.05, 2000
# What chance moves of a ratio counts so many times.
DEVIATIONS = 3.0
# Every two of so many sensors are compared.
FEW_SENSORS = 10

# Slopes of nonlinear columns are taken at so many samples of so many stretches of a record; the step is a
# share of the signal's rms: small against its motion, large against rounding. So many samples are computed at
# once: arrays that stay in a cache.
SLOPE_STRETCHES, SLOPE_SAMPLES = 16, 24
SLOPE_STEP = 1e-4
# What squares of a channel's noise vary by is worked out where they are this share of a line's power, which
# in front of the low-pass is mostly noise where accelerations are; with good sensors they are 1e-11. Products
# of so many axes at most are looked at, of axes at least so long, and of sums of products those with this
# share of the largest: the others are what rounding of covariances leaves.
FELT_SQUARES, MOST_AXES, LEAST_LENGTH, LEAST_PRODUCT = 1e-5, 12, 1e-4, 1e-8
CHANGED_TOGETHER = 8192

# An inertia is tested against so many slow cosines over the records; it counts as changing from this level,
# this share of the residual's power and this share of its value on.
SLOW_CHANGES = 4
CHANGES_LEVEL, CHANGES_EXPLAINED, LEAST_CHANGE_OF_INERTIA = 1e-3, 0.1, 0.05

# Of cut-offs that are tried: a parameter known to this share counts as fully known, what is better than that
# does not decide; estimates that are apart by more deviations of their difference are so for a reason; and
# a bias of this share of a deviation leaves 92 of 95 intervals right.
FULLY_KNOWN, CERTAIN_MOVE, MOST_BIAS = 1e-5, 2.0, 0.5
