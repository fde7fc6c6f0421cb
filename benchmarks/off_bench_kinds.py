"""The kinds of records of `off_bench.py`: machine, sensors, and the one thing that is different."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

from off_bench_machine import Machine

TWO = """
[chain]
name = "two"
motion = "rotation"
[[bodies]]
name = "m"
inertia = "J_m"
viscous = "F_vm"
coulomb = "F_sm"
actuator = "T"
[[bodies]]
name = "c"
inertia = "J_c"
[[links]]
bodies = ["m", "c"]
stiffness = "K"
damping = "D"
ratio = {ratio}
"""
THREE = (
    TWO.replace('name = "two"', 'name = "three"')
    + """
[[bodies]]
name = "l"
inertia = "J_l"
[[links]]
bodies = ["c", "l"]
stiffness = "K_l"
damping = "D_l"
"""
)
SENSORS = {
    "q_m": '{ body = "m", measures = "position" }',
    "q_c": '{ body = "c", measures = "position" }',
    "q_l": '{ body = "l", measures = "position" }',
    "v_m": '{ body = "m", measures = "velocity" }',
    "v_c": '{ body = "c", measures = "velocity" }',
    "a_m": '{ body = "m", measures = "acceleration" }',
    "a_c": '{ body = "c", measures = "acceleration" }',
    "d": '{ deflection = ["m", "c"], measures = "position" }',
}
NAMES = {
    "J_m": lambda m: m.inertia[0], "F_vm": lambda m: m.viscous[0], "F_sm": lambda m: m.coulomb[0],
    "J_c": lambda m: m.inertia[1], "K": lambda m: m.stiffness[0], "D": lambda m: m.damping[0],
    "J_l": lambda m: m.inertia[2], "K_l": lambda m: m.stiffness[1], "D_l": lambda m: m.damping[1],
}  # fmt: skip
AXIS_1 = Machine((9.87e-6, 7.08e-7), (5.64e-5, 0.0), (3.61e-3, 0.0), (0,), (1,), (0.296,), (2.31e-3,))
AXIS_2 = Machine((9.24e-6, 6.76e-7), (3.87e-5, 0.0), (6.23e-3, 0.0), (0,), (1,), (0.38,), (4.86e-4,))
LIGHT = Machine((9.93e-6, 6.72e-7), (2e-5, 0.0), (5e-3, 0.0), (0,), (1,), (0.3795,), (3.9e-5,))
DRIVE = Machine((2e-3, 6e-3), (0.02, 0.0), (0.4, 0.0), (0,), (1,), (1500.0,), (0.6,))
GEARED = Machine((1e-4, 0.8), (2e-3, 0.0), (0.05, 0.0), (0,), (1,), (15000.0,), (12.0,), (100.0,))
CHAIN = Machine(
    (2e-3, 1e-3, 4e-3), (0.02, 0.0, 0.0), (0.4, 0.0, 0.0), (0, 1), (1, 2), (2500.0, 1800.0), (0.5, 0.4)
)
MACHINES = {
    "table_1": AXIS_1,
    "table_2": AXIS_2,
    "light": LIGHT,
    "drive": DRIVE,
    "geared": GEARED,
    "chain": CHAIN,
}


@dataclass(frozen=True)
class Reading:
    """What is wrong with a channel: times in s, `lag_s` of a first-order filter, `step` of an encoder.

    `high_pass_hz` is the corner of an AC coupling.
    """

    late_s: float = 0.0
    clock_ppm: float = 0.0
    gain: float = 1.0
    zero: float = 0.0
    lag_s: float = 0.0
    step: float = 0.0
    high_pass_hz: float = 0.0


@dataclass(frozen=True)
class Kind:
    """One kind of records. `named`: words of a warning that names the cause; `steps`: the force jumps.

    `sums`: the true sums of what the sensors cannot tell apart, for values that are labelled as such.
    """

    name: str
    machine: str = "table_2"
    sensors: tuple[str, ...] = ("q_m", "q_c")
    fs: float = 5000.0
    motions: tuple[str, ...] = ("chirp", "trapezoid")
    duration_s: float = 2.0
    noise: float = 1.0
    change: Callable[[Machine], Machine] = lambda machine: machine
    readings: dict[str, Reading] = field(default_factory=dict)
    lag_s: float = 0.0
    held: bool = False
    noisy_loop: bool = False
    zeros_differ: float = 0.0
    steps: bool = False
    named: tuple[str, ...] = ()
    sums: dict[str, float] = field(default_factory=dict)

    @property
    def nominal(self) -> Machine:
        """The machine as the spec describes it."""
        return MACHINES[self.machine]

    @property
    def truth(self) -> dict[str, float]:
        """Physical parameters by their names in the spec."""
        machine = self.nominal
        three = len(machine.inertia) > 2
        return {
            name: float(value(machine)) for name, value in NAMES.items() if three or not name.endswith("_l")
        }

    @property
    def spec(self) -> str:
        """The TOML text."""
        text = THREE if len(self.nominal.inertia) > 2 else TWO
        lines = "\n".join(f"{key} = {SENSORS[key]}" for key in self.sensors)
        return text.format(ratio=self.nominal.ratio[0]) + f"\n[sensors.s]\n{lines}\n"


def kinds() -> Iterator[Kind]:
    """Yield the kinds, a right model first."""
    yield from _right()
    yield from _timing()
    yield from _readings()
    yield from _physics()


def _right() -> Iterator[Kind]:
    for machine in ("table_1", "table_2", "light", "drive", "geared"):
        yield Kind(f"plain {machine}", machine)
    yield Kind("accelerometer at the load", sensors=("q_m", "a_c"))
    yield Kind("accelerometer, drive", "drive", ("q_m", "a_c"))
    yield Kind("motor encoder alone", sensors=("q_m",))
    yield Kind("motor encoder alone, drive", "drive", ("q_m",))
    yield Kind("two speeds", "drive", ("v_m", "v_c"))
    yield Kind("encoder and deflection", "drive", ("q_m", "d"))
    yield Kind("three bodies, all seen", "chain", ("q_m", "q_c", "q_l"))
    yield Kind("three bodies, middle unseen", "chain", ("q_m", "q_l"))
    yield Kind("4096 lines, table_1", "table_1", readings=_encoders(16384))
    yield Kind("4096 lines, drive", "drive", readings=_encoders(16384))
    yield Kind("no noise", noise=1e-3)
    yield Kind("noise times 5", noise=5.0)
    yield Kind("noise in the loop", "drive", noisy_loop=True)
    yield Kind("1 kHz", fs=1000.0)
    yield Kind("500 Hz, drive", "drive", fs=500.0)
    yield Kind("250 Hz coarse encoders", "drive", fs=250.0, readings=_encoders(8192), duration_s=6.0)
    yield Kind("chirp alone", motions=("chirp",))
    yield Kind("trapezoid alone", "drive", motions=("trapezoid",))
    yield Kind("multisine alone", "drive", motions=("multisine",))
    yield Kind("chirp about rest", motions=("rest",), duration_s=4.0)
    yield Kind("short", "drive", duration_s=0.5)
    yield Kind("force that steps, drive", "drive", steps=True)


def _timing() -> Iterator[Kind]:
    for late_s, words in (
        (10e-6, "10 us"),
        (100e-6, "half a sample"),
        (6e-4, "3 samples"),
        (1e-3, "1 ms"),
        (3e-3, "3 ms"),
    ):
        yield Kind(f"force late by {words}", readings={"T": Reading(late_s=late_s)})
    yield Kind("force early by 0.3 ms, drive", "drive", readings={"T": Reading(late_s=-3e-4)})
    yield Kind("force late by 1 ms, drive", "drive", readings={"T": Reading(late_s=1e-3)})
    for lag_s in (1e-4, 3e-4, 1e-3):
        yield Kind(f"current loop of {1e3 * lag_s:g} ms", lag_s=lag_s, named=("lag",))
    yield Kind("current loop of 0.5 ms, drive", "drive", lag_s=5e-4, named=("lag",))
    yield Kind("force measured behind 0.3 ms", readings={"T": Reading(lag_s=3e-4)}, named=("lag",))
    yield Kind("force held over a sample", held=True, named=("held", "hold"))
    yield Kind("force held, 2 kHz drive", "drive", fs=2000.0, held=True, named=("held", "hold"))
    yield Kind("force held, 1 kHz drive", "drive", fs=1000.0, held=True, named=("held", "hold"))
    yield Kind("load encoder early by a quarter", readings={"q_c": Reading(late_s=-5e-5)}, named=("q_c",))
    yield Kind(
        "load encoder late by a sample, drive",
        "drive",
        readings={"q_c": Reading(late_s=2e-4)},
        named=("q_c",),
    )
    yield Kind(
        "accelerometer late by half a sample",
        sensors=("q_m", "a_c"),
        readings={"a_c": Reading(late_s=1e-4)},
        named=("a_c",),
    )
    yield Kind(
        "accelerometer clock 100 ppm",
        sensors=("q_m", "a_c"),
        readings={"a_c": Reading(clock_ppm=100.0)},
        named=("clock", "a_c"),
    )
    yield Kind(
        "load encoder clock 50 ppm, drive",
        "drive",
        readings={"q_c": Reading(clock_ppm=50.0)},
        named=("clock", "q_c"),
    )
    yield Kind("force clock 500 ppm", readings={"T": Reading(clock_ppm=500.0)}, named=("clock",))


def _readings() -> Iterator[Kind]:
    yield Kind(
        "accelerometer bandwidth 500 Hz",
        sensors=("q_m", "a_c"),
        readings={"a_c": Reading(lag_s=1 / 3141.6)},
        named=("bandwidth", "a_c"),
    )
    yield Kind(
        "load encoder bandwidth 400 Hz, drive",
        "drive",
        readings={"q_c": Reading(lag_s=1 / 2513.3)},
        named=("bandwidth", "q_c"),
    )
    yield Kind(
        "accelerometer behind a high-pass of 0.5 Hz",
        sensors=("q_m", "a_c"),
        readings={"a_c": Reading(high_pass_hz=0.5)},
        named=("high-pass", "a_c"),
    )
    yield Kind(
        "accelerometer behind a high-pass of 0.5 Hz, drive",
        "drive",
        ("q_m", "a_c"),
        readings={"a_c": Reading(high_pass_hz=0.5)},
        named=("high-pass", "a_c"),
    )
    yield Kind(
        "accelerometer gain 1.02",
        sensors=("q_m", "a_c"),
        readings={"a_c": Reading(gain=1.02)},
        named=("gain", "a_c"),
    )
    yield Kind(
        "accelerometer zero 5 m/s^2",
        "drive",
        ("q_m", "a_c"),
        readings={"a_c": Reading(zero=5.0)},
        named=("zero", "offset"),
    )
    yield Kind("zeros 1 mrad apart", readings={"q_c": Reading(zero=1e-3)})
    yield Kind("zeros 10 mrad apart", readings={"q_c": Reading(zero=1e-2)})
    yield Kind("zeros 1 rad apart, drive", "drive", readings={"q_c": Reading(zero=1.0)})
    yield Kind("zeros apart, gear", "geared", readings={"q_c": Reading(zero=0.02)})
    yield Kind("zeros of each record", "drive", zeros_differ=0.05)
    yield Kind("zero of the force", readings={"T": Reading(zero=5e-4)}, named=("offset", "constant force"))


def _physics() -> Iterator[Kind]:
    yield Kind(
        "constant force", change=lambda m: replace(m, offset=0.2 * m.coulomb[0]), named=("offset", "constant")
    )
    yield Kind(
        "friction at the load",
        "drive",
        change=lambda m: replace(m, coulomb=(0.4, 0.12)),
        named=("friction", "Coulomb"),
    )
    yield Kind(
        "friction at the load, accelerometer",
        "drive",
        ("q_m", "a_c"),
        change=lambda m: replace(m, coulomb=(0.4, 0.12)),
        named=("friction", "Coulomb"),
        sums={"F_sm": 0.52},
    )
    yield Kind(
        "viscous friction at the load",
        "drive",
        change=lambda m: replace(m, viscous=(0.02, 0.01)),
        named=("friction", "viscous"),
    )
    yield Kind(
        "quadratic friction", change=lambda m: replace(m, quadratic=3e-7), named=("friction", "quadratic")
    )
    yield Kind(
        "asymmetric friction",
        "drive",
        change=lambda m: replace(m, asymmetry=0.15),
        named=("asymmetr", "forward", "offset"),
    )
    yield Kind(
        "backlash of 1 mrad",
        change=lambda m: replace(m, backlash=1e-3),
        named=("backlash", "stiffen", "deflection"),
    )
    yield Kind(
        "backlash of 0.2 mrad, drive",
        "drive",
        change=lambda m: replace(m, backlash=2e-4),
        named=("backlash", "stiffen", "deflection"),
    )
    yield Kind(
        "stiffening", change=lambda m: replace(m, cubic=200.0), named=("stiffen", "cubic", "deflection")
    )
    yield Kind(
        "stiffening, drive",
        "drive",
        change=lambda m: replace(m, cubic=200.0),
        named=("stiffen", "cubic", "deflection"),
    )
    yield Kind("a belt that creeps", change=lambda m: replace(m, creep=0.03), named=("creep", "damped"))
    yield Kind(
        "a belt that creeps, drive",
        "drive",
        change=lambda m: replace(m, creep=0.02),
        named=("creep", "damped"),
    )
    yield Kind(
        "Stribeck friction",
        change=lambda m: replace(m, stribeck=0.5, stribeck_speed=5.0),
        named=("Stribeck", "friction"),
    )
    yield Kind(
        "Stribeck friction, drive",
        "drive",
        change=lambda m: replace(m, stribeck=0.4, stribeck_speed=1.0),
        named=("Stribeck", "friction"),
    )
    yield Kind(
        "presliding", "drive", change=lambda m: replace(m, bristle=500.0), named=("presliding", "friction")
    )
    yield Kind("force ripple", "drive", change=lambda m: replace(m, ripple=0.1), named=("ripple", "position"))
    yield Kind("a third mass", "drive", change=_third, named=("resonance", "mass", "dynamics"))
    yield Kind(
        "a third mass, accelerometer",
        "table_2",
        ("q_m", "a_c"),
        change=_third_small,
        named=("resonance", "mass", "dynamics"),
    )


def _third(machine: Machine) -> Machine:
    return _with_mass(machine, 5e-4, 400.0, 0.02)


def _third_small(machine: Machine) -> Machine:
    return _with_mass(machine, 1e-7, 0.2, 2e-6)


def _with_mass(machine: Machine, inertia: float, stiffness: float, damping: float) -> Machine:
    """Return a machine with a further body on a spring at the load."""
    return replace(
        machine,
        inertia=(*machine.inertia, inertia),
        viscous=(*machine.viscous, 0.0),
        coulomb=(*machine.coulomb, 0.0),
        first=(0, 1),
        second=(1, 2),
        stiffness=(*machine.stiffness, stiffness),
        damping=(*machine.damping, damping),
    )


def _encoders(counts: int) -> dict[str, Reading]:
    step = 6.283185307179586 / counts
    return {"q_m": Reading(step=step), "q_c": Reading(step=step)}
