"""Where responses end, and what noise and motion are: every limit with its reason."""

from __future__ import annotations

# The error of one difference that is too small to matter: of a fourth derivative it is four times as large,
# and the noise of a sensor is not known to 1e-5.
LARGEST_ERROR = 1e-5
# A filter still passes a tenth of the amplitude at this multiple of its cut-off.
PASSED = 1.3

# Beyond its reach the response is below this share of its peak: rounding of the sum within it.
REACH_TOLERANCE = 1e-15
# The states must reproduce the kernel's tails to this share of its peak, or the operator is refused.
STATE_TOLERANCE = 1e-11

# A power of the transition below this counts as zero: rounding of the sum within the reach.
POWER_TOLERANCE = 1e-15

# A tone exceeds all lines within a tenth of its frequency, except for so many next to it that are its own.
NEAR, LOBE = 0.1, 4
# The band in which a derivative stands out holds this share of its power.
BAND_SHARE = 0.999
# Fewer lines above the noise than this, or less of the power, and nothing moves.
FEWEST_LINES = 3
LEAST_POWER = 1e-3
# A reading that travels by so many standard deviations of its noise moves, however steadily.
LEAST_TREND = 20.0

# The noise is the median of the reading's power in this upper part of the band;
NOISE_FROM = 0.8
# power counts where it is this many times above it: of a million bins of noise, about one is.
NOISE_FACTOR = 20.0

# standing still: this share of the velocity's 99th percentile
STANDSTILL_SHARE = 0.005

# The response to one sample counts as over where it has fallen to this share of its peak.
KERNEL_TOLERANCE = 1e-17

# A jump is looked for in differences of this order: a wave of a quarter of the sampling frequency has 4e-3 of
# its size there, one of a tenth 7e-9. The median of the size of normal noise, in standard deviations;
JUMP_ORDER, MEDIAN_OF_NORMAL = 16, 0.6745
# so many of these are a jump that matters: corners of motion at 5 kHz have six to nine (see BEND), at
# 500 Hz thirty. It is no less than this share of the signal's standard deviation, and jumps are a small share
# of the samples.
JUMP, LEAST_JUMP, MOST_JUMPS = 10.0, 1e-3, 0.1
# A step is what so many samples before do not predict by so many times the usual (of normal noise its
# standard deviation), of all samples and of so many before and behind it; at most this share of the samples
# takes one.
STEP_ORDER, STEP, STEP_APART, MOST_STEPPING = 4, 10.0, 6, 0.3
# The signal bends back behind it by this share of its bend there, and changes by this share of its largest
# change as near as the prediction reaches. That is found in so many rounds, of samples of which it leaves no
# more than so many deviations.
BEND_BACK, STEP_SHARE, STEP_ROUNDS, STEP_NOISE = 0.25, 0.5, 6, 3.0
# How samples are predicted is found from so many, at most; and so often, each time without the steps known.
STEP_ROWS, STEP_PASSES = 5_000, 4

# A reading that begins again after a turn jumps by more than this share of its range, and its other steps
# are no larger than that; with the turns added, no second difference is so many times the largest elsewhere.
WRAP_SHARE, ORDINARY_STEP, SMOOTH_ACROSS = 0.5, 0.25, 2.0

# Readings come every so many samples, at most, where this share of them changes in step: of changes at random
# half of them do. Fewer readings do not tell, nor those that differ by less than so many steps of their
# resolution (median): a slow motion repeats these.
MOST_REPEATS, IN_STEP = 64, 0.98
FEWEST_READINGS, STEPS_OF_READINGS, ENOUGH_READINGS = 50, 3.0, 20_000
# Readings that come between samples: how much finer than its own lines the spectrum is read for their period,
# how often the period is refined, and by how many samples a reading may be off it beside what sampling makes.
FINER, REFINED, LATE = 4, 3, 0.05
# The lowest line of at least this share of the highest is theirs; of readings that come more often than every
# so many samples, changes at random fall into step as well.
AS_HIGH, SHORTEST = 0.9, 1.2

# A bend is looked for from this multiple of the noise on: of normal noise one sample in two million has it.
# Bends are so many steps of a difference apart: farther away that of one is below 3 % of its peak. With steps
# of three samples it stands out three times as far; with wider ones natural frequencies of drives do so, too.
# The place is known to so many samples there.
BEND, BEND_APART, BEND_STEPS, BEND_NEAR = 5.0, 5, (1, 3), 2

# What is usual in a long channel is seen in so many stretches of so many samples.
EXCERPTS, EXCERPT = 16, 1 << 12
# Readings are rounded to a step where most of their differences are nearly integer multiples of the least.
ROUNDING, NEARLY, MOST = 1e-12, 0.1, 0.8
# The least difference may be up to so many steps, where so many differences or more tell.
MOST_STEPS, ENOUGH_STEPS = 4, 12
# The step is looked for among so many neighbouring readings, in so many places, and made exact by differences
# of so many steps.
NEIGHBOURS, MOST_PARTS, REACHES = 32, 64, (4.0, 30.0, 200.0)
# So many numbers of cosines are kept in tables (16 MB); beyond, samples are transformed.
COSINES_KEPT = 1 << 21

# Shares of samples that tell the noise of a reading: half of them, or a tenth where a step is never far.
CALMEST = (0.1, 0.5)
