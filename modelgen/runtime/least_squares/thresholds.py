"""When a fit rests, what counts as zero, how rows are weighted: every limit with its reason."""

from __future__ import annotations

# Rounds of fits and delays, at most; each is a Gauss-Newton step.
DELAY_ROUNDS = 30
# Done when a delay moves by less than this share of its standard deviation, or of a sample.
SMALL_STEP = 0.05
SMALLEST_STEP = 1e-4
# A parameter rests when it moves by less than this share of itself.
SMALLEST_CHANGE = 1e-6
# Simulations are used again where a round moves no delay by more samples than this, and each parameter by
# fewer standard deviations, or by a smaller share of itself. A parameter that moves by k of its deviations
# moves the motion of n samples by about k / sqrt(n) of what the rows leave: instruments are as good then.
SETTLED_DELAY, SETTLED, SETTLED_SHARE = 0.1, 10.0, 0.02
# A delay beyond this, in samples, is no small misalignment any more.
LARGEST_DELAY = 50.0

# Residuals beyond this many standard deviations weigh less: 95 % efficiency where noise is normal (Huber).
TUNING = 1.345
# Rounds of re-weighting, at most.
HUBER_ROUNDS = 50
# At rest when no parameter moves by more than this share of its standard deviation.
SMALL_MOVE = 1e-4

# Singular values of the scaled W below this share of the largest count as zero,
RANK_TOLERANCE = 1e-10
# those of projected rows below this: filters and masks leave so much of what is left out, and rounds along it
# would wander,
SIMULATED_TOLERANCE = 1e-7
# columns that differ by less than this are equal: what a filter leaves of masked samples is up to this share,
# and two bodies that reverse together differ in nothing else,
ALIKE = 1e-5
# and columns with more than this share in such a direction cannot be told from others.
NULL_SHARE = 1e-4
# A solution is refined where rounding may exceed this share of it, and wherever that costs next to nothing;
# beyond this condition number refinement does not converge.
ROUNDING = 1e-11
FEW_ROWS = 5000
REFINABLE = 1e6

# Triangles of twice so many columns are inverted by halves.
HALVED = 32

# Powers of a triangle that its largest singular value is worked out from.
POWERS = 6

# Order of the autoregression, and the fewest samples a coefficient is estimated from.
WHITENING_ORDER = 20
SAMPLES_A_COEFFICIENT = 10
# Power added, as a share: keeps the recursion from meeting a residual of no power at some frequency.
LEAST_POWER = 1e-9

# Solutions: the first with weights from the forces, the others with those of the residuals before.
WEIGHTING_ROUNDS = 3
# No residual counts as smaller than this share of the forces.
SMALLEST_RESIDUAL = 1e-12
# Weight of a row without a force, as a share of what its first residual gives. In simulations with noisy
# sensors 0.1 to 0.3 leave the least bias; with 1 and more it runs away, without the row damping is lost.
LOAD_ROW_SHARE = 0.2
# A load row whose terms shrink to less than this when it is weighted freely is on its way to zero.
RUNAWAY_SHRINKAGE = 0.8

# Rounds of instruments for what drives report; each takes out most of the noise that the last one left.
GAIN_ROUNDS = 20

# Delays in samples that are looked at.
EARLIEST, LATEST = -12, 40
# A delay is worth starting from where it leaves less than this share of the residual without it.
COARSE_BETTER = 0.9
# Samples of a record and row that are looked at.
LOOKED_AT = 20_000

# Combinations of rows that cancel to less than this share of their deviation weigh as if they did not.
SMALLEST_DEVIATION = 1e-2

# Samples back that a row is predicted from, with the rows that share its noise: as many of these at most,
# and only where a correlation at one of the first lags exceeds this.
JOINT_ORDER, MOST_RELATED, LEAST_RELATED, LAGS_LOOKED_AT = 8, 3, 0.1, 2
# Filters and derivatives are exact to this share of a row's largest term; less is no noise to be told apart.
LEAST_NOISE = 1e-8
# Grids whose steps differ by less than this share are alike: noise has the same colour on both.
SAME_STEP = 0.01

# A low-pass of first order is followed for so many time constants, and a few samples more;
LAGS, SHORTEST_REACH = 14.0, 48
# its frequency response is exact up to this share of the sampling frequency,
UNDISTORTED = 0.3
# from where it falls along a Gaussian edge, cut off so many of its widths from the middle,
EDGE_WIDTHS = 4.0
# and sampled so many times finer than the time it is followed for.
RESOLVED = 8

# Of a record: a force that is late by more leaves too little of it, and is given in another unit.
LARGEST_GIVEN_DELAY = 0.25
