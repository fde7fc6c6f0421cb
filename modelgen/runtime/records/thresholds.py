"""What counts as a gap, an offset, activity, the same data, a uniform clock: every limit with its reason."""

from __future__ import annotations

# Order of the low-pass in front of a differentiated source.
FILTER_ORDER = 4

# Below this share of the dynamics' cut-off a chain moves as one: springs deflect by its square, a hundredth.
MOVES_AS_ONE = 0.1
# A lever's size below this share of the largest is what rounding leaves of a zero.
RIGID = 1e-9

GAP = 1.5  # of the median step: a longer one means that samples are missing
SCATTERED = 6.0  # and of the scatter of all steps: chance makes no longer one in a billion
NEAR_GAP = 8  # samples on each side whose stamps say whether those behind a long step stay late
FEW_STEPS = 1 << 16  # are looked at at once
LEFT_BY_A_CUT = 0.1  # of a record: where less is whole in a row, readings are interpolated, and not cut away
NOTED_OFFSET = 0.02  # of a channel's rms: a smaller mean is not reported
ONE_MOTION = 0.9999  # squared correlation of an angle and a place: the ratio between them is known to 1e-4

# Points that the name, the unit and the samples of a column must earn to be proposed for a channel.
LEAST_SCORE = 2.0
# Points that a column loses that never changes: less than a name and a unit that both suit.
STILL = 3.0

# A record of so many samples is looked at as a whole; of a longer one, so many stretches.
WHOLE = 1 << 18
PIECES = 4
# Of what filters make of a channel in memory so many bytes a sample are kept while a record is identified:
# three settings of the filter, decimated by ten, and a velocity at the full rate, for directions. Longer
# records are filtered whenever it is asked for.
FILTERED_BYTES = 20
MOST_FILTERED = 1 << 21
# The record is active where its channels change by this share of what they do where they change most.
ACTIVE = 0.36

# Samples that differ by less than this share of the largest are equal: a table of six digits.
ROUNDING = 6e-6
# Two noises of one size differ by the root of two of it, a record and its rounded copy by no more than the
# rounding, which is the copy's noise.
TWICE = 1.2
# Of the largest sample: what changing a unit leaves.
EXACT = 1e-13
# In units of a look's own largest sample, which may be far below the largest of all.
NEAR = 1e-3
# Two records that share so many changing samples, sample by sample, share a stretch.
SHARED = 64

# Steps from where times began within which they begin again: a logger's first sample may be one later.
RESTART = 1.5
UNIFORM = 1e-3  # of the step: how far a step may be from the others
# Stamps that scatter are judged where there are so many; averages over as many are to be smaller than chance
# makes them by this factor at most: a clock that wanders is not seen in channels.
LEAST_STAMPS, WANDERS = 64, 2.0
# Differences of this order hold little of a motion and all of what scatters from sample to sample; slopes are
# means over so many samples. Stamps are not believed where so many deviations say so.
ROUGH_ORDER, SLOPE_SAMPLES, CERTAIN_SCATTER = 4, 7, 5.0
LONGEST_STEP = 0.05  # s: the motion of a machine is sampled faster
# s: longer steps are of times in ms that do not say so; large machines may be read as seldom as this
UNLIKELY_STEP = 0.11
# Spreadsheets count days since 1900: of these years (1954 to 2119), and steps shorter than this, 0.09 s.
SPREADSHEET_DAYS, SHORT_OF_A_DAY = (2e4, 8e4), 1e-6
AGREEMENT = 1e-3  # relative: how far a stated frequency may be from the one of the times

# So many whole periods at least, for a spread.
FEWEST_PERIODS = 4
# A period is found where a force correlates like this with itself one period later, and a declared one is
# taken.
FOUND_CORRELATION = 0.98
LEAST_CORRELATION = 0.7
# Peaks this much below the highest are as good: multiples of a period differ by chance.
SAME_CORRELATION = 2e-3

# Segments of a measured frequency response, half overlapping: of independent noises 95 % of the coherence
# lies below 0.36.
SEGMENTS = 8
LEAST_COHERENCE = 0.36
SHORTEST_SEGMENT = 16
# Lines below this one hold the segment's own trend.
LOWEST_LINE = 2
# Half overlapping segments under a Hann window are correlated like this in power: (1/6)^2.
OVERLAP_CORRELATION = 1.0 / 36.0
# A line of a periodic input is excited where its mean over the periods exceeds its standard deviation so many
# times, and this share of the largest line.
EXCITED_STD = 4.0
EXCITED_SHARE = 1e-6

# A channel that was set right by less than this share of its spread is rounded as it was read.
LITTLE_CHANGED = 0.1
