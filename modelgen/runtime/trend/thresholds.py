"""Constants that decide whether a quantity has changed."""

# Of all histories without a change, the share in which any quantity is said to have changed.
FALSE_ALARMS = 0.05
# Histories drawn without a change, by which the largest of many differences is judged; fewer of long ones, so
# that they stay within this many numbers, but never fewer than the second.
DRAWS, FEWEST_DRAWS, MOST_NUMBERS = 20_000, 4_000, 4_000_000
BLOCK = 1000  # of them at a time
# Lengths of runs of entries that may differ from those before and after them.
RUNS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128)
# Entries a change: what changes more often scatters.
ENTRIES_A_CHANGE = 4
MOST_ENTRIES = 2000  # of one history: every entry is compared with all others
Z95 = 1.959963984540054
