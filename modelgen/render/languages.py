"""Printers of sums, features and matrix entries in MATLAB (which Octave reads) and in C99."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction

from modelgen.errors import RenderError
from modelgen.render.plain_model import PlainEntry, PlainFeature, PlainModel, Sum
from modelgen.render.printer import weighted_sum

# words that cannot name a member of a structure: of C and C++, and macros of the standard headers,
# which compilers replace in whatever a program includes after them
_C_WORDS = """
    auto break case char const continue default do double else enum extern float for goto if inline int
    long register restrict return short signed sizeof static struct switch typedef union unsigned void
    volatile while asm typeof typeof_unqual bool true false nullptr constexpr alignas alignof
    static_assert thread_local catch class concept consteval constinit const_cast co_await co_return
    co_yield decltype delete dynamic_cast explicit export friend mutable namespace new noexcept operator
    private protected public reinterpret_cast requires static_cast template this throw try typeid
    typename using virtual wchar_t char8_t char16_t char32_t and and_eq bitand bitor compl not not_eq or
    or_eq xor xor_eq complex imaginary I linux unix NULL EOF TRUE FALSE errno stdin stdout stderr
    RAND_MAX BUFSIZ EXIT_SUCCESS EXIT_FAILURE NAN SNAN INFINITY MAXFLOAT HUGE HUGE_VAL HUGE_VALF
    HUGE_VALL DOMAIN SING OVERFLOW UNDERFLOW PLOSS TLOSS near far M_E M_LOG2E M_LOG10E M_LN2 M_LN10 M_PI
    M_PI_2 M_PI_4 M_1_PI M_2_PI M_2_SQRTPI M_SQRT2 M_SQRT1_2
"""
_MATLAB_WORDS = """
    break case catch classdef continue do else elseif end endarguments endclassdef endenumeration
    endevents endfor endfunction endif endmethods endparfor endproperties endspmd endswitch endwhile
    end_try_catch end_unwind_protect enumeration events for function global if methods otherwise parfor
    persistent properties return spmd switch try until unwind_protect unwind_protect_cleanup while
    arguments
"""
# names of files: headers that a compiler would take the model for, and what a class calls, defines or
# computes with
_C_HEADERS = """
    assert complex ctype errno fenv float inttypes iso646 limits locale math setjmp signal stdalign
    stdarg stdatomic stdbit stdbool stdckdint stddef stdint stdio stdlib stdnoreturn string tgmath
    threads time uchar wchar wctype
"""
_MATLAB_OWN = """
    cos sin sign double zeros numel size base_parameters places measurement entries regressor predicted
    base_from_physical state_space names s p d e k x y A B C D E F
"""
C_WORDS = frozenset(_C_WORDS.split())
MATLAB_WORDS = frozenset(_MATLAB_WORDS.split())
C_HEADERS = frozenset(_C_HEADERS.split())
MATLAB_OWN = frozenset(_MATLAB_OWN.split())


@dataclass(frozen=True)
class Language:
    """How one language writes names, features and elements of arrays (indices count from 0 here)."""

    words: frozenset[str]
    no_files: frozenset[str]  # what, besides `words`, a model and its file cannot be called
    longest: int | None  # letters of the longest name, where there is one
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
        """Return a name that is no word of the language; different texts have different names.

        Raises
        ------
        RenderError
            If the language has no names of that length.
        """
        return self._name(text, self.words)

    def file_name(self, text: str) -> str:
        """Return the name of a model and of its file.

        Raises
        ------
        RenderError
            If the language has no names of that length.
        """
        return self._name(text, self.words | self.no_files)

    def _name(self, text: str, taken: frozenset[str]) -> str:
        # `end_` becomes `end__`, because `end` is `end_`
        name = f"{text}_" if text.rstrip("_") in taken else text
        if self.longest is not None and len(name) > self.longest:
            what = f"has {len(name)} letters, and a name in this language at most {self.longest}"
            raise RenderError.at(name, what, "choose a shorter name in the spec")
        return name


MATLAB = Language(
    MATLAB_WORDS,
    MATLAB_OWN,
    63,  # namelengthmax
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
    C_HEADERS,
    None,
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
