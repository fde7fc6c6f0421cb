"""When an estimate has converged, how a model is simulated along a record: every limit with its reason."""

from __future__ import annotations

# Bandwidth of the weak feedback, as a share of the dynamics' frequency; and of what it sees of the record,
# as a multiple of that bandwidth.
FEEDBACK_SHARE = 1.0 / 30.0
SMOOTHING = 4.0
SMOOTHING_ORDER = 2
# A simulation that follows closely has a feedback of this share of the dynamics' frequency. As fast as these,
# it pulled at a body that sticks until that slipped at another instant; a thirtieth leaves further errors.
FOLLOWED_SHARE = 0.2
# It follows itself so many times, less what it was off: a feedback that sees a low-passed motion damps what
# is faster, and a velocity that a low-pass has bent at every reversal of the record had made it turn late.
FOLLOWED_AGAIN = 2
# A record leads a simulation up to this multiple of the dynamics' frequency, whatever the rows' cut-off, and
# up to this share of the sampling frequency at most.
LED, LED_ORDER = 2.0, 4
HIGHEST_LED = 0.4
# Deflections are read from encoders whose noise has less than this share of their power: a spring that
# stiffens with d^3 comes out wrong by three times that share of its stiffness.
UNCLEAR = 1e-4
# They are read from noisier sensors, too, where that noise has less than this share of the power of what they
# read beyond a simulation: that is farther off then. Speeds and accelerations are integrated from these
# shares on of the frequency up to which a feedback sees a record: the lowest at which noise is as little.
FAR_OFF, INTEGRATED_FROM = 0.05, (0.06, 0.125, 0.25, 0.5, 1.0)
# What a link that bends by its form gives less in slow motion is found in so many half steps.
GIVEN_ROUNDS = 6
# A share of a body in a deflection below this one of the largest is rounding.
ROUNDED = 1e-9
# What is followed may differ by at the ends of a stretch for looking no further; relative. Stretches have so
# many samples at least, and are so many times as long as is looked beyond; the last ones made are kept.
START_TOLERANCE = 1e-9
HELD_STRETCH, HELD_REACHES, KEPT_STRETCHES = 1 << 16, 2, 4
# What arms follow of a record, as a multiple of their motion's band, where their controller is not known:
# noise of accelerations grows with the band to the power of five, and rows look at five times the motion's.
ARM_SMOOTHING, ARM_SMOOTHING_ORDER = 2.0, 4

# Gauss-Newton steps from one start, at most; so many where the last come `NEARLY` to rest, or leave less by
# `LEAVES_LESS` (a mean logarithm) than those before: another start takes as many again.
COMPOSITE_ROUNDS, CREEPING_ROUNDS, LEAVES_LESS = 25, 40, 0.1
# Rows are made white when a step moves nothing by more than this many standard deviations, or after so many:
NEARLY, ROUGH_ROUNDS = 3.0, 8
# Done when nothing moves by more than this share of its standard deviation, or of its value;
COMPOSITE_MOVE = 0.02
# Directions of motion jump from sample to sample as parameters move, so that steps do not shrink for ever:
# after so many rounds those are small that are below this.
STILL_ROUNDS, LATER_MOVE = 12, 0.1
SMALL_CHANGE = 1e-6
# what has a standard deviation beyond this share of its value may move: its value is not reported.
HOPELESS = 0.5
# Delays are held where a step moves them by no more standard deviations; so often they are set anew.
HELD_DELAY, HELD_ROUNDS = 2.0, 4
# They are tried at so many starts' own, and these parts of a sample later.
HELD_STARTS, HELD_PARTS = 3, (0.0, 0.5)
# A step changes no parameter of the body or link by more than this share: far away the rows are not linear.
LARGEST_STEP = 0.5
# Where rows leave more by this (a mean logarithm) at its end, a step has led too far: half of it is gone, but
# no less than this part; the next ones grow again.
LEAVES_MORE, LEAST_PART = 0.5, 0.05
# Steps are combined with those before where neither they nor the noise change a size by more than this share.
LINEAR_SHARE = 0.1
# Nor can a parameter be this many times smaller or larger than at the start.
FARTHEST = 1e4
# Where a chain cannot be simulated, those that are so many times smaller or larger than at the start are why;
# from an estimate of nearly the same records no inertia and no stiffness can be.
MANY_TIMES = 10.0

# Rounds of simulation and estimate, at most.
ROUNDS = 20
# Converged: no parameter moves by more than this share of its standard deviation, or of its value.
SMALL_MOVE = 0.01
# A move that is foreseen, not seen, is to stay below this share of that.
FORESEEN = 0.1
# Moves that shrink by this factor and more from round to round can be foreseen.
SHRINKING = 0.5
# Noise-free records are used again for estimates that differ by so many standard deviations, or by this
# share of a value.
NEAR = 3.0
NEAR_SHARE = 0.25
# A row without a force whose terms are all below this share of the forces has gone to zero.
VANISHED_ROW = 1e-6
# Rows hold no more exactly than to this share of their largest term: other forms of one thing are not told
# apart below that, nor is anything looked for.
EXACTNESS = 1e-3
# No residual counts as less than this share of a row's largest term. At 1e-3 a gear of 100 with encoders of
# 3e-6 rad left 3 to 5 times the noise in its load's row, which holds to 1e-5, and every fifth record had
# intervals 20 times too wide; at 1e-5 the scale of a tree's rows that hold exactly is lost.
LEAST_RESIDUAL = 1e-4
# What is negative by less than this share of the largest term is zero, and rounding.
ROUNDED_TERM = 1e-9

# Points a sample on a spline through the force: straight lines take (pi f / fs)^2 / 3 off a sine of f Hz.
BETWEEN = 4
# Fits: weights of the channels come from the residuals of the fit before.
WEIGHTING_ROUNDS = 2
# Evaluations of a fit (max_nfev of SciPy), at most.
MOST_EVALUATIONS = 30
# Differences by the parameters, in shares of their size.
RELATIVE_STEP = 1e-5
# Residual of a trial that cannot be simulated.
FAR = 1e6
# A trial so stiff that a step of the simulation has to be divided into more parts than this, and than twice
# those of the start, is as good as far off: next to no inertia would cost a hundred times the time.
FINEST = 8

# A body with less than this share of the inertia that the actuator feels has vanished.
LEAST_SHARE = 1e-3
# What has vanished is tried as a body of these shares of the inertia that the actuator feels, on a spring
# that lets it swing at this share of the dynamics' frequency with this damping ratio.
TRIED_SHARES = (0.1, 1.0)
TRIED_FREQUENCY = 0.6
TRIED_DAMPING = 0.5
# Rounds in which rows are made linear in delays for a start, and evaluations of each search, at most.
LATE_ROUNDS, ROW_EVALUATIONS = 2, 100
# The search for a start ends when the squared error falls by less than this share: in directions
# that the records hardly determine it would fall slowly for long.
NEAR_ENOUGH = 1e-4
# Of longer records it takes so many stretches of so many samples, each with all periods of the dynamics.
START_STRETCHES, START_SAMPLES = 6, 1000
# Samples at both ends where differences are poor.
EDGE = 10

# What an average lets through is undone down to this share; the exponent of the bend there.
LEAST_PASSED, LEAST_PASSED_BEND = 0.2, 8
# A low-pass of two poles that is late by a is 1 / (1 + a s + r a^2 s^2): r of Butterworth's, the range from
# two equal poles to a damping ratio of 0.4, and the longest steps.
BUTTERWORTH, BENDS, LARGEST_BEND_STEPS = 0.5, (0.25, 1.5), (-0.25, 0.25)
# A high-pass is looked for as one of this corner in rad/s: accelerometers have time constants of a second.
USUAL_CORNER = 1.0
# The speed below which friction rises (Stribeck) is tried at this quantile of the speeds in all records.
SLOW_QUANTILE = 0.1
# Below this share of its largest speed, a body is at rest.
AT_REST = 1e-3

# An effect with less than this share of itself outside of the regressors cannot be told from them.
LEAST_OWN_SHARE = 1e-3
# A late sensor is viscous friction of both bodies at its link but for what the delay does to accelerations;
# filters and derivatives are exact to 1e-5, which is a share of 1e-10.
LEAST_OWN_DELAY = 1e-5
# Below this share a difference of sums of squares has lost digits, and the part outside is worked out itself.
CANCELLED = 1e-6
# An effect of which no more than this share lies outside of the columns is hardly told from them.
LITTLE_OWN = 0.05
# Level of all tests together.
LEVEL = 1e-2
# An effect matters from this share of the residual's power, or where it moves a parameter by so many
# standard deviations.
LEAST_EXPLAINED = 0.03
LEAST_MOVE = 0.5
# Nor does it matter where it moves no parameter by this share of its value.
LEAST_MOVED_SHARE = 3e-4
# What is not estimated is in the intervals from this share of a standard deviation: less would widen none
# by more than 0.005 %, and give every parameter a drift to be read.
LEAST_DRIFT = 1e-2
# What adds more than this multiple of the largest term to the rows is no effect that was overlooked.
LARGEST_SHARE = 3.0
# So many effects are compared with the columns at a time: those of a long chain take as much as its rows.
AT_A_TIME = 256

# Another effect explains the residual as well where it falls behind by less than this, as a chi square.
AS_GOOD = 20.0
# The same of misfits, which are half a chi square.
AS_LIKELY = 0.5 * AS_GOOD
# Rounds with effects, at most; fewer where their sizes are known nearly.
EFFECT_ROUNDS, KNOWN_ROUNDS = 25, 6
# A lag or a delay beyond this, in samples, is no small misalignment any more.
LARGEST_LAG = 50.0
# A force that acts behind a low-pass is late by this share of what that delays, give or take so many samples.
LATE_SHARE, LATE_TOLERANCE = 0.5, 0.2
# Clocks of quartz differ by some 1e-4, those of cheap converters by 1e-3; beyond this it is no clock.
# What is off by more than this share of itself is another unit, or a dead channel, and no gain.
LARGEST_CLOCK, LARGEST_GAIN = 0.01, 0.9
# Done when nothing moves by more than this share of its standard deviation, or of its value.
EFFECT_MOVE = 0.1
# After so many rounds this multiple of that will do: slow rounds would go on for long.
PATIENT_ROUNDS, LOOSER = 12, 3.5
EFFECT_CHANGE = 1e-6
# Steps become shorter by this factor where they turn back.
SHORTER = 0.6

# An effect is tried at this share of the readings' size, and of what it does to directions of motion at this
# one: most reversals then move to another sample.
TRIED_SHARE, TURNED_SHARE = 1e-5, 1e-2

# A row feels a force if that leaves more than this share of its terms, beyond rounding, at some frequencies.
FELT_SHARE, SEEN_AT = 1e-6, 16

# A row that leaves more than this share of its force is told where instruments fail.
LEFT_OF_FORCE = 0.5

# A further mass is looked for from this share of the dynamics' frequency to this multiple of the cut-off,
# each frequency so many times the one before, first with this damping ratio, which is wide enough to be met.
RESONANCES_FROM, RESONANCES_TO, RESONANCE_GRID, FIRST_DAMPING = 0.25, 1.2, 1.15, 0.1
# Steps start from so many shapes of a grid, and are so many at most; done when the logarithm of the
# likelihood grows by less than this. The longest steps of the logarithms of frequency and damping (of creep
# as of damping: it is as wide); a damping ratio stays above this one.
SHAPES_TRIED, SHAPE_STEPS, SAME_SHAPE, LEAST_DAMPING = 2, 12, 1.0, 1e-3
LONGEST_STEPS = ((-0.2, -1.0), (0.2, 1.0))
# Ripple has at least so many periods on the way of a body, fewer are friction or a spring (creep and further
# masses on the longest record, fewer are a stiffer link or a force), and at most so
# many; steps are taken from so many of them, of phases by so many rad at most.
FEWEST_PERIODS, MOST_PERIODS, RIPPLES_TRIED, LONGEST_PHASE = 0.5, 4096.0, 2, 1.0
# A link that creeps is looked for from this share of the dynamics' frequency to the cut-off, each frequency
# so many times the one before: its response is wide.
CREEPS_FROM, CREEPS_GRID = 0.05, 2.0
# A residual is tested for it at frequencies so many times the one before. A link that creeps at all
# frequencies does so up to so many times the cut-off; its tilt takes steps of so much, to this at most.
CREEPS_TESTED, CREEPS_UP_TO, LONGEST_TILT, STEEPEST = 4.0, 3.0, 0.3, 1.0
# A shape is estimated where least squares leave less than this share of the rows with it; steps are taken
# where they leave less than that share at the first.
CLEARLY_LEFT, SEEN_AT_ALL = 0.9, 0.98
# Sensors lead an acceleration where their noise has less than this share of its power.
CLEAR_ACCELERATION = 0.01
# Fits with the shape of an effect estimated, at most; done when its first numbers (the others are linear)
# change by less than this share of their standard deviations.
SHAPE_ROUNDS, SHAPE_NUMBERS, SHAPE_SETTLED = 6, 2, 0.3

# Share of a parameter by which it is moved to see what a row takes of its friction: the fourth root of
# rounding, as the change is a second-order difference of numbers of full precision.
DIFFERENCED = 1e-4
# A low-pass passes what it is made for where its cut-off is so many times that frequency.
SHOWN = 1.25
# Rounds in which the instants of reversals and the speeds that bend there agree.
TURNING_ROUNDS = 8

# A start from responses: so many chains are tried, the best are searched from with so many evaluations.
TRIED_CHAINS, RESPONSE_SEARCHES, RESPONSE_EVALUATIONS = 400, 5, 60
# So many lines of each response are looked at, of those with this coherence at least; none counts for more
# than one with this ratio of signal to noise.
RESPONSE_LINES, COHERENT, MOST_COHERENT = 60, 0.5, 10.0
# What is no number is as far off as this, as the logarithm of a ratio times its weight.
FARTHEST_RESPONSE = 100.0
# A chain that misses half of the measured lines by less than this share comes before other starts.
RESPONSE_CLOSE = 0.3

# A drive's limit is looked for at these shares of the largest force; in one step it moves by no more than
# this share of the way to nothing, or to the largest force.
SATURATED, LONGEST_LIMIT = (0.85, 0.65, 0.45), 0.5

# Rounding of encoders is looked at in so many places of their steps.
ROUNDED_AT = 8
