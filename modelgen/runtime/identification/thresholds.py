"""What gets no number, what is noted, when swapped channels are reported: every limit with its reason."""

from __future__ import annotations

# Drifts that are noted: in standard deviations of the noise, and relative to the value.
NOTED_DRIFT = 2.0
NOTED_SHARE = 1e-3
# A physical parameter from composites needs a relative standard deviation below this.
LARGEST_PERCENT = 20.0
# Of a spring that is known less its compliance is known to so many deviations either way, and is no less than
# this share of what it is: beyond, it may be rigid.
LIKELY_WITHIN, LEAST_COMPLIANCE = 1.96, 0.1

# Columns that move together leave a parameter without a number from this relative standard deviation in % on.
WITHOUT_NUMBER_PERCENT = 100.0

# A row that leaves this share of its largest term unexplained is taken for swapped channels,
UNEXPLAINED = 0.9
# and an exchange is reported if it leaves less than this share of what the worst row left before; or,
# where values were impossible, if none is any more and no row leaves this share of its largest term.
BETTER = 0.5
# A row that leaves less, but this share and more, may lack anything, and is not taken for swapped channels
# unless an exchange leaves a tenth of it: of seven arms with swapped encoders, which left 25 to 89 %, the
# right exchange left 0.1 to 1.1 % of that, and the next best 22 % and more.
LOOKED_INTO, FAR_BETTER = 0.1, 0.1
# Changes that leave as much but for this share are told apart by nothing: a force reversed, or all else.
AS_LITTLE = 0.01
# Solving again costs as much as the estimate: so many times at most for all records, or a part of them; of an
# arm, whose channels are many, so many times a channel, which its neighbours and reversals take.
TRIES, TRIES_A_CHANNEL = 12, 2

# Instruments of stretches tell that a force is late by more than so many standard deviations of its delay.
LATE_CLEARLY = 5.0
# Noise of the sensors does not matter where it pulls least squares by less of a standard deviation than this.
BIAS_SHARE = 0.2
# Least squares and instruments disagree where they are so many standard deviations apart.
DISAGREEMENT = 3.0
# Where instruments find nothing, least squares stands in if noise pulls nothing by more than this share of
# its value, and no row is left unexplained.
STANDS_IN = 0.3

# A force is half a sample early to within this share of a sample: rounded encoders, and directions near
# reversals, move its delay by a tenth. Nor is so short a delay told where rows use samples near reversals.
HALF_SAMPLE = 0.2
# A zero beyond this many standard deviations is told: of a few, none is so by chance.
ZERO_APART = 3.0
# Positions whose mean difference exceeds so many times what it changes by have zeros of their own.
DEFLECTED = 3.0
# Forces may be means over so many samples: shorter ones move nothing, and no drive reports longer ones; its
# own delay adds a tenth.
SHORTEST_MEAN, LONGEST_MEAN, WHOLE_SAMPLE = 0.2, 1.1, 0.1
# No command acts before it is given: by more than this share of a sample it is another cause.
LEAST_BEFORE = 0.2
# Bends of a force at every sample count where they move a parameter by more than so many standard deviations:
# half of one widens its interval by a tenth.
LEAST_BENT = 0.5
# Of two explanations the other one counts where its chance is at least this, and it moves a parameter by more
# than so many standard deviations; the largest exponent of odds.
HARDLY_SHOWS, HARDLY_MOVES, MOST_EXPONENT = 1e-3, 0.1, 50.0
# A command takes steps at its samples where this share of them is one.
STEPS_TAKEN = 2e-3
# A sensor feels a force at once that moves it by this share of what it reads, at least: less is rounding.
FELT_AT_ONCE = 1e-6
# Channels may be late by these parts of a sample where a hold leaves as little.
PARTS_LATE = (-0.5, -0.25, 0.25, 0.5)
# A command is held over a whole sample, or over a part of one, of which these are tried; what is likeliest is
# found between them. Instruments tell it by what lengths this share of it apart leave.
HOLDS_TRIED, SHARPENED_HOLD = (0.0625, 0.125, 0.25, 0.5), 0.1
# Nearer to half a sample than this delays are not known, in samples.
LEAST_APART = 0.01
# Rounds in which a command is taken as held, at most; done when it moves by less than this share of a sample.
HELD_ROUNDS, HELD_SETTLED = 3, 5e-3
# What a low-pass in the reading undoes of how a hold averages, at most, for a command to be one that is held.
UNDONE = 0.5
# How long a controller holds what it adds to the steps of a command hardly shows, where that has a deviation
# of so many samples: anywhere between 0 and 1 it has 0.29.
REST_UNKNOWN = 0.15
# Directions change at instants that are known to this share of a sample at best: speeds are read at samples,
# and bend in between.
KNOWN_INSTANT = 0.02
# Directions are simulated so often, each time with the last estimate: the first is a few percent off.
TURNED_ROUNDS = 2
# They are made anew where what the model lacked explains so much of the residual, a share of its rms.
TURNED_GAIN = 0.05
# So many effects are estimated with physical parameters at most, one after the other.
SHOWN_EFFECTS = 3
# Reversals that a low-passed velocity does not see count where they move a parameter by more than this share
# of its standard deviation.
TURNS_MOVE = 0.5
# So many effects are estimated at most: the records do not hold more.
MOST_EFFECTS = 3
# Steps of a search, those counted that take one effect in place of another.
SEARCH_STEPS = 20
# What an effect moves is known to this share, by kind: channels are set right by a low-pass of first order,
# a held force has images beyond half the sampling frequency that fold back into the positions (0.4 (pi f /
# fs)^2 of what the average does), what acts on the chain is worked out in first order and has one form of
# many (of what creeps at all frequencies links with three elements came out to 0.05 to 0.25); noise of the
# reading blurs the limit of a drive; friction about reversals is not known where rows are as inexact. What
# explains less than the last share of the residual that it leaves may be of that order.
INEXACT = {
    "lag": 0.002,
    "two poles": 0.002,
    "average": 0.02,
    "force": 0.02,
    "form": 0.05,
    "drift": 0.05,
    "mass": 0.05,
    "resonance": 0.02,
    "creep": 0.02,
    "structural damping": 0.3,
    "ripple": 0.05,
    "saturation": 0.02,
    "direction": 0.05,
    "reversal": 1.0,
}
LITTLE_LEFT = 0.05
# A ripple that leaves noise alone has no other harmonics: it is known as what is read behind a low-pass is.
RIPPLE_ALONE = 0.002
# What is found after one of these kinds may be what its form leaves: all that it moves is left open.
ROUGH = {"form", "mass"}
# A clock that drifts by fewer samples than this over the longest record is none: rows are no more exact.
# Nor is so short a delay told, though it is estimated.
LEAST_CLOCK_DRIFT = 0.02
# No gain is known to this share: what so small a one explains on a long way is something else. Nor does a
# drive saturate that follows all but this share of what is commanded beyond a limit.
LEAST_SIZE = {"gain": 1e-6, "saturation": 0.01}
# A row is left unexplained from this share of its largest term on, and this multiple of the sensors' noise.
LEFT_SHARE = 0.3
OVER_NOISE = 3.0
# Below this multiple of the sensors' noise a residual is that noise, and its colour says how rows weigh best.
NOISE_ALONE = 1.5
# Rows times columns that are made white at most, as they are kept several times for that; bytes a number.
MOST_WHITENED, COPIES_OF_WHITE_ROWS = 5e6, 80.0

# A residual of physical parameters whose statistic of whiteness is beyond so many times its bound is that of
# another chain than the records' (right ones mostly had 0.3 to 1.1 times it, wrong ones 8 to 40), if it is so
# many deviations away from the one whose residual is white. Cut-offs equal but for the last factor are one.
COLOURED, OTHER_CHAIN, EVEN = 3.0, 8.0, 1.05
# Other cut-offs are tried in steps of the root of two, so many at most; so many in vain end it. Lower ones
# are where noise biases a parameter by more than this share.
CUTOFF_STEPS, STEPS_IN_VAIN = 13, 2
# So many higher ones where springs give no positions at the first: they gave what slow arms tell.
CUTOFFS_WITHOUT_ESTIMATE = 3
LITTLE_BIAS = 0.1
# Biases by noise come out as predicted to 5 %, so that this share may be left where they are taken off.
LEFT_BIAS = 0.1
# What noise of the forces does to instruments is known up to this share of these along a direction; it came
# out to the next share, in simulations with up to an eighth, and of friction to half where rows use samples
# near reversals.
MOST_DRIVEN, LEFT_DRIVEN, LEFT_TURNING = 0.25, 0.05, 0.5
# Where noise is more of a direction of the columns, what it does is not known to a third, and no bias is
# taken off; below, that share of a bias may be left.
FIRST_ORDER = 1.0 / 3.0
# A row without a force may leave this share of its largest term; more where it did so at first.
LOAD_ROW_LEFT = 0.5
# Digits a parameter by which another cut-off has to be better, and by which it may be worse than the best.
CLEARLY_BETTER, NEARLY_BEST = 0.15, 0.1
# Digits a parameter by which instruments have to know more at another cut-off.
KNOWN_BETTER = 0.05
# Samples of a record that cut-offs are tried on, and stretches of it in which their estimates are compared.
SAMPLES_TRIED, STRETCHES_TRIED = 1 << 17, 1 << 10

# So many effects at a time are estimated in turn, if they explain this share of what the first one does; and
# as many that are as sure, in deviations, as this share of the surest.
MOST_TRIED, TRIED_TOO, AS_SURE = 3, 0.3, 0.9
# Parameters that vary, not certain along a tangent, are likely from this share of the residual's power on:
# far from the truth a tangent tells half of a size, and what it leaves is in the deviation.
SUSPECTED = 0.1

# Delays of a sensor, and time constants of its low-pass, in samples that are looked at where a row is left
# unexplained; and by how many samples a clock may have drifted at the end, at most by this share.
SENSOR_DELAYS = (-8.0, -4.0, -2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 4.0, 8.0)
LOW_PASSES = (1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 11.0, 16.0)
# Corners of an accelerometer's high-pass: powers of two in rad/s, 0.04 to 5 Hz.
HIGH_PASSES = (-2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0)
CLOCK_DRIFTS = tuple(float(by) for by in (*range(-16, 0), *range(1, 17)))
LARGEST_CLOCK_TRIED = 3e-3
# Sizes so many samples more and less than the best are looked at as well; samples of each record.
FINER = (0.5, 0.25)
LOOKED_AT = 20_000
# They are estimated where they leave less than this share of what rows leave without.
CLEARLY_LESS = 0.9
# Effects leave less than this share (rms) of what least squares leaves without them where they are the cause.
# On real machines, where they stand in for several causes, they leave 0.6 to 0.85.
FAR_LESS = 0.5
# Residuals of instruments up to this multiple of the sensors' noise raise no alarm by their colour alone.
CALM = 1.5

# Samples of a record in which effects are looked for, in so many stretches where there are more. With half as
# many samples intervals of noisy records of 1e6 came out up to twelve times as wide; with half as many
# stretches those of long chirps did, of which each shows one band.
SEARCHED, STRETCHES = 1 << 16, 4
# Where filters leave that room, means over at least so many samples are taken in place of stretches, at least
# so many a period of the highest cut-off: differences of these err by little. Where another cut-off is
# decided on, of which a period has fewer than so many, they are made anew.
LEAST_THINNED, FINE, FEWEST_MEANS = 4, 20.0, 10.0

# Limits of memory are stated in these.
MEGABYTE = 1e6
# Rows of arms by least squares that take more are made again where records stay in files, without a limit.
KEPT_OF_FILES_MB = 128.0
# What methods that do not make their rows again take, measured on two bodies: copies of the rows
# (instruments, projections, moved columns); with instruments of the channels of the longest record, too.
COPIES_OF_ROWS = 8.0
COPIES_OF_ROWS_IV, COPIES_OF_CHANNELS = 5.0, 5.0
# To cut records is no remedy where fewer samples would be left.
FEWEST_LEFT = 5000

# A spring that deflects by more than so many times the motion of its joint carries no link: rows about it
# hold nothing but that, and a slide in slow motion ended at hardly any stiffness.
MOST_DEFLECTED = 30.0
# Where rows hold positions that springs give: deflections as shares of the motion to start from, steps after
# which starts are compared, the first of them that hold springs and dampers and as many more that hold
# dampers, most steps, and the last step's size in units of the residual's norm, or of the rows' where there
# is no noise; the least cosine between steps that go one way, how far ratios of a series differ, and its
# longest sum in units of its first.
DEFLECTIONS = (0.3, 0.1, 0.03, 0.01, 0.002)
SETTLING_STEPS = 5
HELD_STEPS = 2
MOST_STEPS = 20
POINT_TOLERANCE = 1e-4
WITHIN_NOISE = 0.1
ONE_WAY, SAME_RATIO, LONGEST_SERIES = 0.95, 0.05, 10.0
ROUNDING = 1e-11
# Of motors alone: deflections to start from, those first that mostly lead somewhere, far from each other: two
# that agree end it; steps that hold springs and dampers, along directions that rows of unit columns show by
# more than this share of the best shown one; steps that hold dampers, steps after which starts are compared,
# and more from so many of the best.
LIKELY_DEFLECTIONS = (0.01, 0.1, 0.03, 0.002, 0.3)
FIRST_STEPS, HARDLY_SEEN = 2, 0.1
STEPS_HELD, FEW_STEPS, MORE_STEPS, BEST_PLACES = 4, 5, 20, 2
# Where those lead to nothing but what is far over noise: shares of the motion by which springs deflect, each
# by another, near a mode by more than the motor moves; how many such starts, and those that leave least, from
# which steps are taken. Of 16 for three springs three led to the right place. Steps to the root: to rounding.
# One spring alone has nothing to be in ratio to.
FEWEST_SCATTERED = 2
SCATTERED, SCATTERED_STARTS, LIKELY_STARTS, ROOT_STEPS = (0.003, 3.0), 16, 4, 60
# The first weight of a step's changes, of columns of length one, where it leaves more without, and the
# largest; what a step is to gain at least, a logarithm, and how near springs are at one place, a share of
# their stiffness.
FIRST_DAMPING, MOST_DAMPING, SETTLED, SAME_PLACE = 1e-3, 1e3, 0.1, 0.1
# A spring whose deviation is more than this share of it is held at multiples, on and on until it is less
# likely by so many deviations, or by the furthest factor; rounds of better places, steps to each.
LITTLE_KNOWN, MULTIPLES, EXCLUDED, FURTHEST = 0.05, (0.5, 2.0), 4.0, 64.0
BETTER_PLACES, STEPS_ELSEWHERE = 3, 6
# Directions that rows of unit columns see by less than this share of the best seen one are not moved along.
UNSEEN = 1e-10
# Where forces are open a step is halved if rows are then less likely by more than this, a logarithm; steps of
# less than this share end it.
AS_LIKELY, SHORTEST_STEP = 3.0, 0.05
# By how many times the spring's part a damper's may be at the fastest motion of any joint (a soft one may be
# damped little, and another move at ten times its mode), and that of a damper that pushes, by noise alone.
LONGEST_LAG, FURTHEST_AHEAD = 3.0, 0.5

# The share of a record that every row of an arm is to keep where instruments leave turns out, at least. With
# half of it and gaps intervals are a fifth too narrow in simulations, which is less harm than turns that stay
# in; the larger share is given up where it costs more than this of the digits that the best cut-off knows.
LEAST_CALM, CALM_SHARE, CALM_DIGITS = 0.5, 0.75, 0.55
# Least squares of an arm that leave this share of a row, and this multiple of the noise, lack what no
# instruments would cure; in simulations stick and slip alone leaves up to four times the noise.
LEFT_BY_ARMS, FAR_OVER_NOISE = 0.01, 6.0
# Where a record tells nothing in a row, as friction reverses all the time, instruments that add friction are
# taken if the parameter that is known worst is known by this factor better.
TELLS_MORE = 0.5

# Channels of elastic arms: rounds of steps, which end where all are less than this share of their deviations,
# and after so many rounds than that one; what is then below so many deviations stood in for something else.
# There are no instruments, and intervals of motors alone are narrow: certain is so much more than usual.
# While steps do not rest, what is taken up explains this share of the residual; what explains so nearly as
# much as the best is as good.
ALIGNING_ROUNDS, ALIGNMENT_AT_REST, PATIENT_ALIGNING, NEARLY_AT_REST = 15, 0.1, 5, 0.3
ALIGNED_APART, MORE_CERTAIN, LARGE_PART, ALIKE_PART = 5.0, 1.5, 0.1, 0.85
# So many samples of each record are looked at: rows of six joints then take less than 100 MB.
ALIGNED_ON = 1 << 15
# What is tried of a delay in samples, of a gain, and of a zero as a share of what a channel spans: small
# against what bends rows, large against rounding. Channels later than so many samples are another mistake.
TRIED_SAMPLES, TRIED_GAIN, TRIED_ZERO, MOST_ALIGNED_SAMPLES = 0.05, 1e-4, 1e-5, 50.0
# A late position is nearly a damper and friction times a large stiffness: of its rows, as a share of their
# power, so little that is none of the columns is told from rounding of small differences.
LEAST_ALIGNED_SHARE = 1e-7
# Where all that tells two explanations apart is this many deviations of the better one, rows do not.
# What explains this share of what another one does is the same to rows.
AS_CERTAIN, SAME_PART = 3.0, 0.999
# A gear, a length or an angle off by more than this share is no mistake of a file: what bends rows as much is
# something else.
MOST_ALIGNED_GAIN = 0.2
# A delay of so many samples is less than rows resolve, and so is such a gain.
LEAST_ALIGNED_SAMPLES, LEAST_ALIGNED_GAIN = 0.02, 1e-5

# Of two estimates with bodies exchanged the less likely one is none where it is so by more, as a logarithm.
# The true one has been less likely by 26, by what a model lacks beside and by colour of the residual. By as
# much is a place of springs less likely where something is negative that cannot be.
TOLD_APART = 100.0
# What nothing explains is tried once more without this share of every record at either end: brakes are
# released and set within the first and the last half second of records of some seconds.
END_SHARE = 0.125
# That is where least squares of the rest leave more there by this factor (rms) in a row: a force that moves
# nothing is many times what a row leaves, and what is hard to explain everywhere varies by less.
LEFT_AT_ENDS = 1.5
