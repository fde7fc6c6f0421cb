"""Printers of sums, features and matrix entries in MATLAB (which Octave reads) and in C99."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction

from modelgen.render.plain_model import PlainEntry, PlainFeature, PlainModel, Sum
from modelgen.render.printer import weighted_sum

# words that cannot name a member of a structure
C_WORDS = frozenset(
    (
        *("auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else", "enum"),
        *("extern", "float", "for", "goto", "if", "inline", "int", "long", "register", "restrict", "return"),
        *("short", "signed", "sizeof", "static", "struct", "switch", "typedef", "union", "unsigned", "void"),
        *("volatile", "while", "asm", "typeof", "bool", "true", "false", "NULL", "I", "linux", "unix"),
    )
)
MATLAB_WORDS = frozenset(
    (
        *("break", "case", "catch", "classdef", "continue", "do", "else", "elseif", "end", "endfor"),
        *("endfunction", "endif", "endwhile", "enumeration", "events", "for", "function", "global", "if"),
        *("methods", "otherwise", "parfor", "persistent", "properties", "return", "spmd", "switch", "try"),
        *("until", "unwind_protect", "while", "arguments"),
    )
)


@dataclass(frozen=True)
class Language:
    """How one language writes names, features and elements of arrays (indices count from 0 here)."""

    words: frozenset[str]
    signal: str  # how a signal's member is reached, such as "s->{}"
    parameter: str
    direction: str
    element: Callable[[str, int, int], str]
    functions: Mapping[str, str]
    operations: Mapping[str, str]
    times: str
    if_moves: str
    end_if: str
    end: str

    def name(self, text: str) -> str:
        """Return a name that is no word of the language."""
        return f"{text}_" if text in self.words else text


MATLAB = Language(
    MATLAB_WORDS,
    "s.{}",
    "p.{}",
    "d.{}",
    lambda matrix, row, column: f"{matrix}({row + 1}, {column + 1})",
    {"sign": "sign({})", "forward": "double({} > 0)", "backward": "double({} < 0)", "cube": "({}) .^ 3"},
    {
        **{"add": "{} + {}", "subtract": "{} - {}", "multiply": "{} .* {}", "divide": "{} ./ {}"},
        **{"negative": "-{}", "positive": "{}", "cos": "cos({})", "sin": "sin({})", "sign": "sign({})"},
        **{"greater": "double({} > {})", "less": "double({} < {})"},
    },
    " .* ",
    "if {} {} 0, ",
    ", end",
    ";",
)
C99 = Language(
    C_WORDS,
    "s->{}",
    "p->{}",
    "d->{}",
    lambda matrix, row, column: f"{matrix}[{row}][{column}]",
    {
        "sign": "(double)(({0} > 0.0) - ({0} < 0.0))",
        "forward": "(double)({} > 0.0)",
        "backward": "(double)({} < 0.0)",
        "cube": "cubed({})",
    },
    {
        **{"add": "{} + {}", "subtract": "{} - {}", "multiply": "{} * {}", "divide": "{} / {}"},
        **{"negative": "-{}", "positive": "{}", "cos": "cos({})", "sin": "sin({})"},
        **{"greater": "(double)({} > {})", "less": "(double)({} < {})"},
        "sign": "(double)(({0} > 0.0) - ({0} < 0.0))",
    },
    " * ",
    "if ({} {} 0) {{ ",
    " }",
    ";",
)


def signal_sum(language: Language, model: PlainModel, parts: Sum) -> str:
    """Return a sum of signals and features as source."""
    features = {feature.key: feature for feature in model.features}

    def source(key: str) -> str:
        if key == "1":
            return "1.0"
        if key in features:
            return feature_source(language, features[key])
        return language.signal.format(language.name(key))

    return weighted_sum((Fraction(coefficient), source(key)) for coefficient, key in parts)


def feature_source(language: Language, feature: PlainFeature) -> str:
    """Return a nonlinear feature as source."""
    inner = weighted_sum((Fraction(c), language.signal.format(language.name(key))) for c, key in feature.of)
    text = language.functions[feature.function].format(inner)
    if feature.times is None:
        return text
    return f"{text}{language.times}{language.signal.format(language.name(feature.times))}"


def state_space_lines(language: Language, model: PlainModel) -> Iterator[str]:
    """Yield the assignments that fill A, B, C, D, E and F, which are zero before."""
    count = len(model.bodies)
    for index in range(count):
        yield f"{language.element('A', index, count + index)} = 1.0{language.end}"
    for entry in model.entries:
        yield _entry_line(language, model, entry)
    widths = {"A": 2 * count, "B": len(model.actuators), "E": len(model.resistances)}
    for row, output in enumerate(model.outputs):
        for place, factor in output.combination:
            if output.order < 2:
                target = language.element("C", row, place + count * output.order)
                yield f"{target} = {factor!r}{language.end}"
                continue
            for out, matrix in (("C", "A"), ("D", "B"), ("F", "E")):
                for column in range(widths[matrix]):
                    target = language.element(out, row, column)
                    value = language.element(matrix, count + place, column)
                    yield f"{target} = {target} + {factor!r} * {value}{language.end}"


def _entry_line(language: Language, model: PlainModel, entry: PlainEntry) -> str:
    def source(name: str) -> str:
        if name in model.known:
            return repr(float(model.known[name]))
        return language.parameter.format(language.name(name))

    total = weighted_sum((Fraction(c), "1.0" if name == "1" else source(name)) for c, name in entry.sum)
    target = language.element(entry.matrix, entry.row, entry.column)
    line = f"{target} = {target} + ({total}) / {source(entry.inertia)}{language.end}"
    if entry.direction is None:
        return line
    body, sense = entry.direction
    opened = language.if_moves.format(
        language.direction.format(language.name(body)), ">" if sense > 0 else "<"
    )
    return f"{opened}{line}{language.end_if}"
