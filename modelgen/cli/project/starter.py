"""modelgen new --project: a commented project file for a chain."""

from __future__ import annotations

from modelgen.errors import SpecError
from modelgen.spec.chain import ChainSpec


def starter_project(name: str, chain: ChainSpec) -> str:
    """Return the text of a project file for a chain in NAME.toml, its first sensor set chosen.

    Raises
    ------
    SpecError
        For a chain without sensors, or without a force: nothing can be identified.
    """
    from modelgen.render.environment import environment

    forces = [body.actuator for body in chain.bodies if body.actuator]
    if not chain.sensor_sets:
        raise SpecError.at(f"{chain.source}: sensors", "is missing", "write a table [sensors.NAME]")
    sensors, *others = chain.sensor_sets
    channels = [sensor.key for sensor in chain.sensor_sets[sensors]]
    template = environment().get_template("project.toml.j2")
    return template.render(
        name=name,
        spec=f"{name}.toml",
        sensors=sensors,
        others=others,
        parameter=chain.parameters[-1].name,
        channel=channels[0],
        actuator=(forces or channels)[0],
    )
