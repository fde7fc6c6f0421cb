"""Where parameters are near a bound, dependent, ambiguous or unanswered: every limit with its reason."""

from __future__ import annotations

# Parameter vectors, ten decades wide, that show which sign a composite of positive parameters has.
DRAWS = 200
# A parameter that lies this close to its bound (in columns of unit length, against Y) is at it.
AT_BOUND = 1e-9
# A value is impossible if it is negative by more than this many standard deviations, and cannot be.
BEYOND_CHANCE = 3.0
# Bounds contradict the records where what they cost is beyond so many standard deviations.
CONTRADICTED = 3.0

# A condition index above this is a near dependence (Belsley, Kuh and Welsch: 30 and more), and a parameter
# takes part in it if it owes this share of its variance to it.
LARGEST_INDEX = 30.0
VARIANCE_SHARE = 0.5
# What a column adds to a combination is left unsaid below this share (of columns of equal length).
SMALLEST_SHARE = 0.05
# The parameter that the others are combined with is the first one of at least this share in a direction.
PIVOT_SHARE = 0.3
# Factors of a sum are rounded to as many digits as let its standard deviation grow by no more than this, and
# to so many at most.
GROWN_BY_DIGITS, MOST_DIGITS = 1.2, 8
# A sum of parameters without numbers of their own is given where its interval is within this share of it.
KNOWN_SHARE = 0.3
# Beyond this the columns are as good as equal, and no variance can be worked out from them.
HIGHEST_INDEX = 1e7

# Starts of the search for other solutions.
STARTS = 24
# Spread of the starts, in the logarithms of the parameters: a factor of about 20 either way.
SPREAD = 3.0
# Two solutions differ where a parameter differs by more than this share.
DIFFERENT = 1e-2
# A solution fits as well if its misfit exceeds the best by no more (95 % of chi-square, one degree).
AS_GOOD = 3.84

# Starts of the search for the parameters nearest to composites that contradict each other: the spread of the
# first, and of the others, in the logarithms of the parameters; so many of the optima start a weighted fit.
NEAREST_STARTS, NEAREST = 12, 3
NEAREST_SPREADS = (0.1, 3.0)
# A misfit (sum of squared relative errors) below this is none; the same optimum agrees by this share.
EXACT = 1e-20
SAME_MISFIT = 1e-6
# Relative errors beyond this count less and less in the search that a few bent composites do not mislead; in
# another, those beyond this multiple of their standard deviation, but not below that share. First damping,
# steps at most, and how far one goes in a logarithm.
ROBUST_SHARE = 0.1
OPTIMISM, LEAST_SHARE = 100.0, 0.01
ROBUST_DAMPING = 1e-3
ROBUST_STEPS = 60
LARGEST_LOG_STEP = 3.0
# With this share every relative error counts as in least squares.
ANY_SHARE = 1e3

# Composites that their own fit misses with less than this probability contradict each other beyond noise.
CONTRADICTION = 1e-3

# Central differences of smooth functions: the cube root of the rounding error.
RELATIVE_STEP = 6e-6
# Gauss-Newton steps, and the relative step at which they rest: they converge quadratically, or not at all.
STEPS = 30
CONVERGED = 1e-12
# Relative steps below this are taken as they are: whether the misfit falls is a matter of rounding by then.
SMALL_STEP = 1e-6
# Singular values and components below these count as zero; scaled by the parameters, all are of size one.
RANK_TOLERANCE = 1e-9
NULL_SHARE = 1e-6
# A parameter depends on others that explain this share of its variance.
HANGING_SHARE = 0.75
# Standard deviations in a direction are taken as at least this share of the largest (after scaling to one).
SMALLEST_SPREAD = 1e-5

# Steady motion: this share of the velocity's power below this share of the dynamics' frequency.
STEADY_SHARE = 0.01
STEADY_BAND = 1.0 / 20.0

# Curvature added to an arm's least squares in columns of unit length: what no base parameter sees stays near
# zero, and the others move by less than a thousandth of a standard deviation.
SMALLEST_CURVATURE = 1e-9
# By how much Clarabel may leave the cones, relative to the parameters in those units.
SOLVER_TOLERANCE = 1e-10
# Duality gap, relative to the square of the largest parameter in these units, thousands of deviations.
SOLVER_GAP = 1e-11

# A bound holds a parameter, or a link, that it moves by so many standard deviations.
HELD = 1e-2

# Bodies are as likely as matrices made of seven random points, two more than make thin ones unlikely: each
# further point is worth half the logarithm of the determinant.
CENTRED = 1.0
# Where bounds raise chi-square by less than this the rows know shapes better than what is likely.
WORTH_CENTRING = 1.0
# Likely bodies are looked for from inside, links enlarged by this share, by so many steps at most, until one
# promises to gain less than this in log-likelihood; steps halved to less than the last number lead nowhere.
LIFTED, CENTRING_STEPS, SMALLEST_GAIN, SHORTEST_STEP = 0.05, 100, 1e-3, 1e-12
# What bends down counts in a step by the first of these shares that leaves a minimum; sizes that nothing
# tells stay where they are.
CONCAVE_SHARES = (0.98, 0.8, 0.5, 0.0)

# A sum of inertias is given in place of those that are not known where its deviation is below this, in %.
KNOWN_SUM_PERCENT = 5.0
