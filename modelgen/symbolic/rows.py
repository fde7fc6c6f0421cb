"""Rows for a sensor set: equations differentiated until every coordinate in them can be read.

A row is differentiated the smallest number of times r for which every coordinate appears at or above the
order its sensor gives. Differentiation drops what is constant between reversals (Coulomb friction, offsets),
so the sums of lower r (see `equation_sums`) are added to the rows of the bodies and hold those.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence

from modelgen.errors import ModelError
from modelgen.spec.chain import ChainSpec
from modelgen.spec.units import ORDER
from modelgen.symbolic.elimination.composites import Composites
from modelgen.symbolic.elimination.elimination import eliminated_rows
from modelgen.symbolic.elimination.force_free_rows import scaled
from modelgen.symbolic.elimination.length_limit import LengthLimit
from modelgen.symbolic.elimination.polynomials import choose_coordinates
from modelgen.symbolic.elimination.unique_rows import UniqueRows
from modelgen.symbolic.equations.equation_sums import NEVER, groups, sum_terms
from modelgen.symbolic.equations.newton import MotionEquations, deflection
from modelgen.symbolic.equations.row import IdentificationRows
from modelgen.symbolic.equations.sensor_reading import Candidate, Reader
from modelgen.symbolic.equations.sensor_span import Sensing
from modelgen.symbolic.equations.signals import DIRECTIONS, Exact, Term
from modelgen.symbolic.equations.term_sum import paused_collector


@paused_collector()
def identification_rows(motion: MotionEquations, sensor_set: str) -> IdentificationRows:
    """Choose, differentiate and read the rows of a sensor set.

    Raises
    ------
    ModelError
        If a body has no sensor, no force acts anywhere, or a cubic stiffness would have to be differentiated.
    """
    spec = motion.spec
    sensors = spec.sensor_sets[sensor_set]
    _refuse_forceless(spec)
    sensing = Sensing.of(spec, sensors)
    reader = Reader(spec, sensing, f"{spec.source}: sensors.{sensor_set}")
    composites = Composites(spec.parameters)
    chosen = _choose(motion, sensing, composites, reader)
    rows = tuple(reader.row(candidate, times) for candidate, times in chosen)
    features = tuple(reader.features.values())
    return IdentificationRows(
        spec, sensor_set, sensors, rows, reader.signals_in_order(), features, composites.named
    )


def differentiations(terms: Iterable[Term], sensing: Sensing) -> int | None:
    """Return the smallest r after which every coordinate term can be read; None if there is none."""
    highest = 0
    for order, combination in coordinate_combinations(terms):
        level = sensing.level(combination, order)
        if level is None:
            return None
        highest = max(highest, level)
    return highest


def coordinate_combinations(terms: Iterable[Term]) -> list[tuple[int, dict[str, Exact]]]:
    """Group coordinate terms by parameter and order: what one column reads together."""
    table: dict[tuple[str | None, str, int], dict[str, Exact]] = {}
    for parameter, signal, coefficient in terms:
        if signal.kind == "coordinate" or (signal.kind in DIRECTIONS and signal.order):
            table.setdefault((parameter, signal.kind, signal.order), {})[signal.name] = coefficient
    return [(order, combination) for (_, _, order), combination in table.items()]


def _refuse_forceless(spec: ChainSpec) -> None:
    if not any(body.actuator for body in spec.bodies):
        raise ModelError.at(
            f"{spec.source}: bodies",
            "no force is measured or known anywhere, so only the ratios to each other of "
            f"{', '.join(parameter.name for parameter in spec.parameters)} can be identified",
            'give the body that is driven an actuator, for example actuator = "Gamma_m"',
        )


def _choose(
    motion: MotionEquations, sensing: Sensing, composites: Composites, reader: Reader
) -> list[tuple[Candidate, int]]:
    """Return the rows of bodies, the sums that need fewer differentiations, eliminations; each with its r."""
    chosen: list[tuple[Candidate, int]] = []
    level_of_body: dict[str, int] = {}
    for equation in motion.equations:
        times = differentiations(equation.terms, sensing)
        if times is not None:
            level_of_body[equation.body] = times
            origin = f"equation of motion of {equation.body}"
            chosen.append((Candidate(equation.body, (equation.body,), equation.terms, origin), times))
    chosen += _sums(motion, sensing, level_of_body)
    if len(level_of_body) < len(motion.equations):
        chosen += _eliminations(motion, sensing, sensing, composites, reader.where)
    chosen += _recovered(motion, sensing, composites, chosen, reader.where)
    for candidate, times in chosen:
        reader.refuse_cubes(candidate, times)
    if composites.named:  # without an elimination every row shares its columns with one that a force enters
        chosen = scaled(chosen, motion.spec, composites)
    return _named_apart(chosen)


def _named_apart(chosen: Iterable[tuple[Candidate, int]]) -> list[tuple[Candidate, int]]:
    """Number rows of the same name: two eliminations may take the same equations."""
    count: Counter[str] = Counter()
    named = []
    for candidate, times in chosen:
        count[candidate.name] += 1
        number = count[candidate.name]
        name = candidate.name if number == 1 else f"{candidate.name} ({number})"
        named.append((candidate._replace(name=name), times))
    return named


def _eliminations(
    motion: MotionEquations, sensing: Sensing, seen: Sensing, composites: Composites, where: str
) -> Iterator[tuple[Candidate, int]]:
    """Yield the rows that eliminate what `seen`, a part of the sensors, does not see.

    A row is left out that holds friction of another size each way of a body whose own motion no sensor gives.
    """
    coordinates = choose_coordinates([equation.body for equation in motion.equations], seen)
    limit = LengthLimit(motion, coordinates, where)
    candidates = eliminated_rows(motion, coordinates, limit)
    usable, directed = False, dict[str, None]()
    for row in UniqueRows(motion, coordinates, sensing).choose(candidates, limit):
        candidate = composites.candidate(row)
        times = differentiations(candidate.terms, sensing)
        if times is None:
            signals = [term.signal for term in candidate.terms]
            directed |= dict.fromkeys(s.name for s in signals if s.kind in DIRECTIONS and s.order)
            continue
        usable = True
        yield candidate, times
    if directed and not usable:
        bodies = ", ".join(directed)
        what = f"friction that differs by direction needs the motion of {bodies} itself: no sensor gives it"
        raise ModelError.at(where, what, f"add a sensor on {bodies}, or make its friction symmetric")


def _recovered(
    motion: MotionEquations,
    sensing: Sensing,
    composites: Composites,
    chosen: Sequence[tuple[Candidate, int]],
    where: str,
) -> Iterator[tuple[Candidate, int]]:
    """Yield undifferentiated rows for friction and offsets that every chosen row has lost by differentiation.

    An accelerometer on a body makes the rows of its neighbours differentiated ones. Without it, the body is
    eliminated, and what the other sensors give may need no differentiation at all.
    """
    kept = {term.parameter for c, times in chosen if not times for term in c.terms if _constant(term)}
    lost = {t.parameter for e in motion.equations for t in e.terms if _constant(t)} - kept
    for order in (0, 1):
        sensors = tuple(s for s in sensing.sensors if ORDER[s.measures] <= order)
        if not lost or not sensors or len(sensors) == len(sensing.sensors):
            continue
        try:
            found = list(_eliminations(motion, sensing, Sensing.of(motion.spec, sensors), composites, where))
        except ModelError:  # an elimination that cannot be done recovers nothing
            continue
        for candidate, times in found:
            held = {name for t in candidate.terms if _constant(t) for name in composites.held(t.parameter)}
            if times == 0 and held & lost:
                lost -= held
                yield candidate, times


def _constant(term: Term) -> bool:
    kind, order = term.signal.kind, term.signal.order
    return kind in ("one", "sign") or (kind in DIRECTIONS and order == 0)


def _sums(
    motion: MotionEquations, sensing: Sensing, level_of_body: Mapping[str, int]
) -> Iterator[tuple[Candidate, int]]:
    if not any(level_of_body.values()):
        return
    seen = set()
    terms_of = {equation.body: equation.terms for equation in motion.equations}
    for level, group in groups(motion.spec, link_levels(motion.spec, sensing)):
        if group.bodies in seen or not all(body in level_of_body for body in group.bodies):
            continue
        terms = sum_terms(terms_of, group)
        times = differentiations(terms, sensing)
        if times is not None and times <= level and times < max(level_of_body[b] for b in group.bodies):
            seen.add(group.bodies)
            origin = f"sum of the equations of {', '.join(group.bodies)}"
            yield Candidate("+".join(group.bodies), group.bodies, terms, origin), times


def link_levels(spec: ChainSpec, sensing: Sensing) -> list[int | None]:
    """Return how often each link's force must be differentiated before the sensors give it."""
    levels: list[int | None] = []
    for link in spec.links:
        stretch = dict(deflection(link))
        needed = [sensing.level(stretch, order) for order in ((0, 1) if link.damping else (0,))]
        known = [level for level in needed if level is not None]
        levels.append(max(known) if len(known) == len(needed) else NEVER)
    return levels
