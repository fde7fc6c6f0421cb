"""Job: what is to be estimated from what, and the rows that it asks for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

from modelgen.array_types import FloatArray
from modelgen.runtime.diagnostics.row_noise import exceeding_noise
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.identification.thresholds import COPIES_OF_WHITE_ROWS, MOST_WHITENED, NOISE_ALONE
from modelgen.runtime.least_squares.coarse_delays import coarse_delays
from modelgen.runtime.least_squares.delays import Run, delay_rates, fit_with_delays
from modelgen.runtime.least_squares.efficient_weights import efficient
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.gain_instruments import gain_columns, with_gain_instruments
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.given_directions import with_given_directions
from modelgen.runtime.rows.left_open.uncertain_turns import without_uncertain_turns
from modelgen.runtime.rows.masks import Survey, direction_keys
from modelgen.runtime.rows.observation import Observation, observe
from modelgen.runtime.rows.rows_by_tag import rows_by_tag

if TYPE_CHECKING:
    from modelgen.runtime.iv.companion_simulation import Loop
    from modelgen.runtime.iv.effect import Effect
    from modelgen.runtime.iv.instrumental_variables import Setting

# takes records to those that are estimated from in their place
Change = Callable[[tuple[Record, ...]], tuple[Record, ...]]


@dataclass(frozen=True, eq=False)
class Job:
    """What is to be estimated from what; see `modelgen.identify` for the options.

    `late` names the force channels whose delay is estimated as well. `start` is a fit at other settings,
    close to the one wanted; it saves rounds. `robust`, `bounds` and `at_zero` are for physical parameters
    fitted to composites; other fits are treated afterwards, see `robust_and_bounded`. `surveys` are those of
    an observation of the records with the same filter for directions, or nothing. `effects` are what the
    model lacks and is estimated as well, from `sizes` on. Rows of least squares that take more than
    `memory_limit` bytes are made again whenever they are asked for. Instruments start at the physical
    parameters `begin`, if there are any and no `start`; where these are an estimate of nearly the same
    records, with `known_delays` in s, they start nowhere else. Least squares uses samples that feel a
    reversal only with `turns`, instruments with `reversing`, or where few others are left; in `physical`
    steps they take these as well where rows drop friction, which is added. `changes` are what was done to
    the records that were given, in this order. The job of stretches has a `share` of the samples that are to
    be estimated from. `guessed` are directions in the records that neither a sensor nor the user gives.
    What rounding has moved in least squares is undone if they are `polished`. With `leave_open`, rows leave
    forces open where speeds do not tell directions. `unaligned` are the records before channels were set
    right that had been read late, off zero or off scale; nothing where none were.
    """

    model: Model
    records: tuple[Record, ...]
    choice: FilterChoice
    drop: int = 0
    rows_for_tag: Mapping[str, Sequence[str]] | None = None
    loop: Loop | None = None
    late: tuple[str, ...] = ()
    start: Fit | None = None
    robust: str | None = None
    bounds: str | None = None
    at_zero: tuple[str, ...] = ()
    surveys: tuple[Survey, ...] = ()
    effects: tuple[Effect, ...] = ()
    sizes: tuple[float, ...] = ()
    memory_limit: float | None = None
    begin: Mapping[str, float] | None = None
    known_delays: Mapping[str, float] | None = None
    turns: bool = True
    reversing: bool = False
    physical: bool = False
    changes: tuple[Change, ...] = ()
    share: float = 1.0
    guessed: tuple[str, ...] = ()
    polished: bool = True
    leave_open: bool = True
    unaligned: tuple[Record, ...] = ()

    @property
    def all_sizes(self) -> tuple[float, ...]:
        """Sizes of all effects to begin with: zero for those behind the ones that are known."""
        return (*self.sizes, *[0.0] * (len(self.effects) - len(self.sizes)))

    def changed(self, change: Change) -> Job:
        """Return the job with other records in the place of its own."""
        return replace(self, records=change(self.records), changes=(*self.changes, change))

    def observed(
        self, records: tuple[Record, ...], turns: bool = True, friction: bool = False
    ) -> Observation:
        """Return the rows of records that these stand for, delays compensated, say."""
        rows = self.with_rests(records, turns, friction, self.leave_open)
        if self.leave_open:
            rows = without_uncertain_turns(rows, self.model, records, self.choice, self.drop, turns)
        return self.only_rows_for_tag(rows)

    def with_rests(
        self, records: tuple[Record, ...], turns: bool = True, friction: bool = False, opened: bool = True
    ) -> Observation:
        """Return the same rows before forces are left open; if they will not be, without what feels rests."""
        surveys, limit, every = self.surveys, self.memory_limit, turns or self.reversing
        used: bool | Literal["open"] = "open" if every and opened else every
        rows = observe(self.model, records, self.choice, self.drop, used, surveys, limit, friction)
        if every and not turns:
            feel = [bool(direction_keys(self.model, row)) for row in range(len(self.model.rows))]
            blocks = tuple(replace(block.kept(), turning=feel[block.row]) for block in rows.blocks)
            rows = replace(rows, blocks=blocks)
        return with_given_directions(rows, self.model, records, self.choice, self.drop, every)

    def observing(
        self, turns: bool = True, friction: bool = False
    ) -> Callable[[tuple[Record, ...]], Observation]:
        """Return the same for one alignment of the forces after another: directions stay, found once."""
        surveys = [self.surveys]

        def observed(records: tuple[Record, ...]) -> Observation:
            rows = replace(self, surveys=surveys[0]).observed(records, turns, friction)
            surveys[0] = rows.surveys
            return rows

        return observed

    def only_rows_for_tag(self, observation: Observation) -> Observation:
        """Return the rows that the records' tags may feed."""
        if self.rows_for_tag is None:
            return observation
        return rows_by_tag(observation, self.records, self.rows_for_tag)

    def calm(self, records: tuple[Record, ...]) -> Observation:
        """Return the rows without the samples around reversals, which a consistent estimate must not use."""
        return self.observed(records, turns=False)

    def with_delays(self, run: Run, finish: Callable[[Fit], Fit] | None = None) -> tuple[Observation, Fit]:
        """Return the rows and the fit of `run`, delays of forces estimated where they are asked for."""
        if not self.late:
            observation, fit = run(self.records, None)
            return observation, fit if finish is None else finish(fit)
        near = self.start if self.start is not None and self.start.delays else None
        return fit_with_delays(self.records, self.late, run, self.rates, self._first_delays, near, finish)

    def sharpened(self, fit: Fit) -> Fit:
        """Return a fit with instruments solved on white rows, if it leaves noise of the sensors alone.

        What a model lacks is no noise: weights made of it would only trade one of its errors for another.
        Stretches are solved as all samples will be: a cut-off that is best for white rows only is of no use
        where these do not fit.
        """
        numbers = sum(block.count * len(fit.touched(index)) for index, block in enumerate(fit.blocks))
        limit = self.memory_limit
        room = MOST_WHITENED if limit is None else min(MOST_WHITENED, limit / COPIES_OF_WHITE_ROWS)
        if numbers > room * self.share:
            return fit
        if exceeding_noise(self.model, self.records, self.choice, fit, NOISE_ALONE):
            return fit
        return efficient(fit, self.choice.steps_s(self.records))

    def with_gains(self, fit: Fit, records: tuple[Record, ...]) -> Fit:
        """Return a fit by least squares, with instruments for what drives report whose gains are columns."""
        gains = gain_columns(self.model)
        if not gains:
            return fit

        def noise(record: int, key: str) -> float:
            facts = records[record].facts
            return facts.spectrum(key).noise / (facts.extent(key).span ** 2 or 1.0)

        return with_gain_instruments(fit, gains, noise)

    def _first_delays(self, fit: Fit) -> Mapping[str, float]:
        """Return the delays of forces in s to start from: none, where all that rows leave may be noise.

        Noise in a column rewards what makes its parameter small, as a delay does that is none: then 15 ms
        may leave half as much.
        """
        if not exceeding_noise(self.model, self.records, self.choice, fit, NOISE_ALONE, rounded=True):
            return dict.fromkeys(self.late, 0.0)
        return coarse_delays(fit, self.model, self.records, self.choice, self.late)

    def setting(self, records: Sequence[Record] | None = None) -> Setting:
        """Return what the model is simulated with: these records, delays compensated, say, or the job's."""
        # its simulation is loaded by those who use it only
        from modelgen.runtime.iv.instrumental_variables import Setting

        given = self.records if records is None else records
        return Setting(self.model, given, self.choice, self.drop, self.loop, self.guessed)

    def rates(self, fit: Fit, records: tuple[Record, ...], channel: str) -> Sequence[FloatArray]:
        """Return how the mismatch of a fit's rows changes with the delay of a force channel, in 1/s.

        One array a block, shape (n,).

        Of arms it is taken of the noise-free forces of the instruments, where there are any: rows of a wide
        band hold more of the derivative of noise than of that of a slow joint's force.
        """
        if self.model.is_arm and fit.simulated is not None:
            records = tuple(fit.simulated.get(index, record) for index, record in enumerate(records))
        return delay_rates(fit, self.model, records, self.choice, self.drop, channel)
