"""Sine, exponential and other functions without branches, from + - * / and a few exact
bit operations.

Every compiled engine and the Python floats evaluate these same lines, so that they
agree to the last bit: a library's ``sin`` differs from one machine to the next, and
none is written for vectors of any width. Largest errors in units of the last place of a
double: exp 0.9, log 0.8, sin and cos 1.4 (|x| up to 1e5), atan2 1.5, tanh 1.3, asin and
acos 2, tan 2.5 (|x| up to 20). Each constant is split so that single precision keeps
its own accuracy; there the log of a number under 1.2e-38 is good to a unit only.

Source: fdlibm (Sun Microsystems 1993), kernels of sin, cos, exp and log; Cephes
(Moshier 1989), atan and tanh; argument reduction Cody, Waite 1980.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import SimpleNamespace

from skyarm.algebra.scalars import floats
from skyarm.algebra.scalars import functions as f
from skyarm.algebra.scalars.fold import Scalar
from skyarm.algebra.scalars.functions import register

TWO_OVER_PI = 0.6366197723675814
HALF_PI_PARTS = (
    1.5703125,
    0.0004837512969970703,
    7.549789948768648e-08,
    6.123233995736766e-17,
)
LN2_HIGH, LN2_LOW, ONE_OVER_LN2 = (
    0.693145751953125,
    1.4286068203094173e-06,
    1.4426950408889634,
)
PI, HALF_PI, QUARTER_PI = 3.141592653589793, 1.5707963267948966, 0.7853981633974483
HALF_PI_LOW = 6.123233995736766e-17

SIN = (
    -1.66666666666666324348e-01,
    8.33333333332248946124e-03,
    -1.98412698298579493134e-04,
    2.75573137070700676789e-06,
    -2.50507602534068634195e-08,
    1.58969099521155010221e-10,
)
COS = (
    4.16666666666666019037e-02,
    -1.38888888888741095749e-03,
    2.48015872894767294178e-05,
    -2.75573143513906633035e-07,
    2.08757232129817482790e-09,
    -1.13596475577881948265e-11,
)
EXP = (
    1.66666666666666019037e-01,
    -2.77777777770155933842e-03,
    6.61375632143793436117e-05,
    -1.65339022054652515390e-06,
    4.13813679705723846039e-08,
)
LOG = (
    6.666666666666735130e-01,
    3.999999999940941908e-01,
    2.857142874366239149e-01,
    2.222219843214978396e-01,
    1.818357216161805012e-01,
    1.531383769920937332e-01,
    1.479819860511658591e-01,
)
ATAN_P = (
    -6.485021904942025371773e1,
    -1.228866684490136173410e2,
    -7.500855792314704667340e1,
    -1.615753718733365076637e1,
    -8.750608600031904122785e-1,
)
ATAN_Q = (
    1.945506571482613964425e2,
    4.853903996359136964868e2,
    4.328810604912902668951e2,
    1.650270098316988542046e2,
    2.485846490142306297962e1,
    1.0,
)
TANH_P = (
    -1.61468768441708447952e3,
    -9.92877231001918586564e1,
    -9.64399179425052238628e-1,
)
TANH_Q = (
    4.84406305325125486048e3,
    2.23548839060100448583e3,
    1.12811678491632931402e2,
    1.0,
)


def horner(z: Scalar, coefficients: Sequence[float]) -> Scalar:
    """Polynomial c0 + c1 z + c2 z^2 + ... by Horner's rule."""
    total: Scalar = coefficients[-1]
    for c in reversed(coefficients[:-1]):
        total = total * z + c
    return total


def _even_polynomial(z: Scalar, c: Sequence[float]) -> Scalar:
    """Polynomial of degree five in z = x^2, by Estrin's scheme."""
    square = z * z
    return (c[0] + c[1] * z) + square * ((c[2] + c[3] * z) + square * (c[4] + c[5] * z))


def _quarter_turns(x: Scalar) -> tuple[Scalar, Scalar, Scalar, Scalar]:
    """Sine and cosine of x modulo pi/2, with the flag of an odd number of quarter turns
    and the sign of half turns.
    """
    turns = f.floor(x * TWO_OVER_PI + 0.5)
    r = x
    # pi / 2 in parts of few bits: products with a small whole number are exact, so the
    # remainder keeps its digits (Cody, Waite)
    for part in HALF_PI_PARTS:
        r = r - turns * part
    z = r * r
    # the sign of a zero is the remainder's
    sine = f.copysign(r + (r * z) * _even_polynomial(z, SIN), r)
    cosine = 1.0 - (0.5 * z - (z * z) * _even_polynomial(z, COS))
    # modulo 4 by floor, which every engine has exactly
    quarters = turns - 4.0 * f.floor(0.25 * turns)
    turned = quarters > 1.5
    return (
        sine,
        cosine,
        f.where(turned, quarters - 2.0, quarters) > 0.5,
        f.where(turned, -1.0, 1.0),
    )


def _odd_function(x: Scalar, value: Scalar) -> Scalar:
    """Value of an odd function that is close to x near zero; x itself where x * x
    underflows.
    """
    return f.where(x * x <= 0.0, x, value)


def sin(x: Scalar) -> Scalar:
    """Sine of x."""
    sine, cosine, odd, side = _quarter_turns(x)
    return f.where(odd, cosine, sine) * side


def cos(x: Scalar) -> Scalar:
    """Cosine of x."""
    sine, cosine, odd, side = _quarter_turns(x)
    return f.where(odd, -sine, cosine) * side


def tan(x: Scalar) -> Scalar:
    """Tangent of x."""
    return f.divide(sin(x), cos(x))


def exp(x: Scalar) -> Scalar:
    """Exponential of x; inf above 709.78, 0 below -745."""
    # clipped, so that 2**k stays a number also where the result is chosen below
    k = f.floor(f.clip(x, -746.0, 710.0) * ONE_OVER_LN2 + 0.5)
    high, low = x - k * LN2_HIGH, k * LN2_LOW
    r = high - low
    z = r * r
    c = r - z * horner(z, EXP)
    y = 1.0 - ((low - f.divide(r * c, 2.0 - c)) - high)
    # two factors, because 2**k alone leaves the range of normal numbers at both ends
    first = f.floor(0.5 * k)
    scaled = y * f.power_of_two(first) * f.power_of_two(k - first)
    # ends of the range: overflow, and half of the least subnormal number
    return f.where(
        x > 709.782712893384, float("inf"), f.where(x < -745.1332191019412, 0.0, scaled)
    )


def log(x: Scalar) -> Scalar:
    """Natural logarithm of x; -inf at zero, NaN below."""
    # a mantissa from sqrt(1/2) to sqrt(2): the logarithm's series is shortest there
    big = f.mantissa(x) > 1.4142135623730951
    k = f.exponent(x) + f.where(big, 1.0, 0.0)
    m = f.mantissa(x) * f.where(big, 0.5, 1.0) - 1.0
    s = f.divide(m, 2.0 + m)
    z = s * s
    R = z * horner(z, LOG)
    half = 0.5 * m * m
    value = k * LN2_HIGH - ((half - (s * (half + R) + k * LN2_LOW)) - m)
    inside = f.where(x < float("inf"), value, x)
    # below the least normal number there is no such exponent: taken for 0
    return f.where(
        x > 2.2250738585072014e-308,
        inside,
        f.where(x >= 0.0, float("-inf"), float("nan")),
    )


def _atan01(t: Scalar) -> Scalar:
    """Arctangent of t in [0, 1]."""
    # Cephes' bound: beyond it the argument is turned by 45 degrees, to within 0.2
    far = t > 0.66
    r = f.where(far, f.divide(t - 1.0, t + 1.0), t)
    z = r * r
    value = r + r * f.divide(z * horner(z, ATAN_P), horner(z, ATAN_Q))
    # pi / 4 in two parts, the small one first: half of what pi / 2 has
    return f.where(far, (value + 0.5 * HALF_PI_LOW) + QUARTER_PI, value)


def atan2(y: Scalar, x: Scalar) -> Scalar:
    """Angle of the point (x, y) in [-pi, pi], with IEEE signed zeros."""
    ax, ay = f.absolute(x), f.absolute(y)
    steep = ay > ax
    low, high = f.where(steep, ax, ay), f.where(steep, ay, ax)
    # equal sizes, two infinities too, are one; a NaN beside an infinity compares false
    # and stays
    ratio = f.where(low >= high, 1.0, f.divide(low, high))
    angle = _atan01(f.where(high <= 0.0, low, ratio))
    angle = f.where(steep, (HALF_PI - angle) + HALF_PI_LOW, angle)
    # what PI lacks of pi, 1.2e-16, stays out: 0.28 units above 2; below 2 half of it
    # makes good what HALF_PI lacked
    angle = f.where(f.copysign(1.0, x) < 0.0, PI - angle, angle)
    return f.copysign(angle, y)


def asin(x: Scalar) -> Scalar:
    """Inverse sine of x; NaN outside [-1, 1]."""
    return atan2(x, f.sqrt((1.0 - x) * (1.0 + x)))


def acos(x: Scalar) -> Scalar:
    """Inverse cosine of x; NaN outside [-1, 1]."""
    return atan2(f.sqrt((1.0 - x) * (1.0 + x)), x)


def tanh(x: Scalar) -> Scalar:
    """Hyperbolic tangent of x."""
    z = x * x
    # as Cephes: a rational function below 0.625, 1 - 2 / (e^(2 x) + 1) above it
    small = _odd_function(x, x + x * f.divide(z * horner(z, TANH_P), horner(z, TANH_Q)))
    size = f.absolute(x)
    large = 1.0 - f.divide(2.0, exp(2.0 * size) + 1.0)
    return f.where(size < 0.625, small, f.copysign(large, x))


COMPOSED: dict[str, Callable[..., Scalar]] = {
    "sin": sin,
    "cos": cos,
    "tan": tan,
    "exp": exp,
    "log": log,
    "atan2": atan2,
    "asin": asin,
    "acos": acos,
    "tanh": tanh,
}
"""Elementary functions by name, for generated code that has no mathematical library."""


BASIC = (
    "divide",
    "sqrt",
    "floor",
    "absolute",
    "where",
    "logical_and",
    "logical_or",
    "logical_not",
)
BITS = ("copysign", "power_of_two", "exponent", "mantissa")

NAMESPACE = SimpleNamespace(
    **{name: getattr(floats, name) for name in (*BASIC, *BITS)}, **COMPOSED
)

for kind in (float, int, bool):
    register(kind, NAMESPACE)
