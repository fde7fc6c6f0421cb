"""The picture of a chain from its spec, or from a generated module alone."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

from modelgen.chain_picture.diagram import GROUND, ChainDiagram, DrawnBody, DrawnDeflection, DrawnLink
from modelgen.chain_picture.svg import chain_svg
from modelgen.errors import SpecError, listed
from modelgen.runtime.model.chain_matrices import ChainMatrices, chain_matrices
from modelgen.runtime.model.link_couplings import NEGLIGIBLE, couplings
from modelgen.runtime.model.mechanical_parts import Sensor as ModelSensor
from modelgen.runtime.model.model import Model
from modelgen.spec.chain import ChainSpec, Sensor

MOST_BODIES = 60  # in a report; what is beyond is a page of its own


def draw_chain(chain: ChainSpec | Model, sensors: str | None = None) -> str:
    """Return the picture of a chain as SVG: bodies, springs, dampers, ratios, ground, forces, sensors.

    Parameters
    ----------
    chain : ChainSpec or Model
        A spec, or a generated module.
    sensors : str, optional
        The sensor set of a spec to show; by default the sensors of all sets. A module has one set.

    Raises
    ------
    SpecError
        When the spec has no such sensor set.

    Examples
    --------
    >>> import modelgen
    >>> picture = modelgen.draw_chain(modelgen.load_spec("axis.toml"))  # doctest: +SKIP
    """
    if isinstance(chain, Model):
        return chain_svg(diagram_of_model(chain))
    return chain_svg(diagram_of_spec(chain, sensors))


def chain_section(model: Model) -> str:
    """Return the picture as an element of the report; of a very long chain a sentence."""
    bodies = sum(len(role.bodies) for role in model.roles.values() if role.role == "inertia")
    if bodies > MOST_BODIES:
        return f"<p>{bodies} bodies: modelgen show --svg draws them.</p>"
    return chain_svg(diagram_of_model(model), alone=False)


def diagram_of_spec(spec: ChainSpec, sensors: str | None = None) -> ChainDiagram:
    """Return what the picture of a spec shows; the parameters are those of `draw_chain`."""
    if sensors is not None and sensors not in spec.sensor_sets:
        remedy = f"choose from {listed(spec.sensor_sets)}"
        raise SpecError.at(f"{spec.source}: sensors", f"has no set {sensors!r}", remedy)
    chosen = (sensors,) if sensors else tuple(spec.sensor_sets)
    seen = list(dict.fromkeys(sensor for name in chosen for sensor in spec.sensor_sets[name]))
    bodies = []
    for body in spec.bodies:
        signs = ("_plus", "_minus") if body.friction == "asymmetric" else ("",)
        rubs = [f"{name}{sign}" for name in (body.viscous, body.coulomb) if name for sign in signs]
        read = _readings(seen, body.name)
        bodies.append(DrawnBody(body.name, body.inertia, tuple(rubs), body.offset, body.actuator, read))
    links = [
        DrawnLink(
            *link.bodies,
            tuple(name for name in (link.stiffness, link.stiffness3) if name),
            link.damping,
            _ratio(link.ratio),
        )
        for link in spec.links
    ]
    return ChainDiagram(spec.title or spec.name, tuple(bodies), tuple(links), _deflections(seen))


def diagram_of_model(model: Model) -> ChainDiagram:
    """Return what the picture of a generated module's chain shows; ratios are found in its state space."""
    matrices = chain_matrices(model)
    forces = {actuator.body: actuator.key for actuator in model.actuators}
    bodies = []
    for name, inertia in zip(matrices.bodies, matrices.inertias, strict=True):
        role = {kind: _named(model, kind, name) for kind in ("viscous", "coulomb", "offset")}
        offset = next(iter(role["offset"]), None)
        rubs = (*role["viscous"], *role["coulomb"])
        read = _readings(model.sensors, name)
        bodies.append(DrawnBody(name, inertia, rubs, offset, forces.get(name), read))
    title = model.title or model.chain
    return ChainDiagram(title, tuple(bodies), _links(model, matrices), _deflections(model.sensors))


def _named(model: Model, kind: str, body: str) -> tuple[str, ...]:
    return tuple(name for name, role in model.roles.items() if role.role == kind and body in role.bodies)


def _links(model: Model, matrices: ChainMatrices) -> tuple[DrawnLink, ...]:
    """Return the links: every pair of bodies, or body and ground, that a stiffness couples."""
    found: dict[tuple[str, str], DrawnLink] = {}
    for name in matrices.stiffness:
        for link in couplings(model, matrices, name):
            first = matrices.bodies[link.first]
            second = GROUND if link.second is None else matrices.bodies[link.second]
            ratio = _ratio(1.0 / link.factor)
            ends = tuple(body for body in (first, second) if body != GROUND)
            damping = _of_link(model, "damping", ends)
            cubes = _of_link(model, "stiffness3", ends)
            known = found.get((first, second))
            springs = (*(known.springs if known else ()), name, *(() if known else cubes))
            found[first, second] = DrawnLink(first, second, springs, next(iter(damping), None), ratio)
    return tuple(found.values())


def _of_link(model: Model, kind: str, ends: tuple[str, ...]) -> tuple[str, ...]:
    """Return the parameters of a kind that act between these bodies, or more where a name is shared."""
    of = {name: role.bodies for name, role in model.roles.items() if role.role == kind}
    exact = tuple(name for name, bodies in of.items() if set(bodies) == set(ends))
    return exact or tuple(n for n, bodies in of.items() if set(ends) < set(bodies) and len(ends) > 1)


def _ratio(ratio: Fraction | float) -> str | None:
    """Return a ratio as it is shown, None for 1."""
    if abs(float(ratio) - 1.0) < NEGLIGIBLE:
        return None
    if isinstance(ratio, Fraction) and ratio.denominator < 100:
        return str(ratio)
    return f"{float(ratio):.6g}"


def _readings(sensors: Iterable[Sensor | ModelSensor], body: str) -> tuple[tuple[str, str], ...]:
    return tuple((sensor.key, sensor.measures) for sensor in sensors if sensor.body == body)


def _deflections(sensors: Iterable[Sensor | ModelSensor]) -> tuple[DrawnDeflection, ...]:
    return tuple(DrawnDeflection(s.key, s.measures, *s.deflection) for s in sensors if s.deflection)
