"""Sixteen float32 at a time: vectors as values in compiled code, with the same bits on every machine.

A kernel that names its vectors needs no luck with what a compiler finds in a loop, and says itself in which order it
adds. Arithmetic is IEEE's and nothing is contracted but by `fma`; the processor's own width does not matter: what is
wider than it is done in parts. Values of type LANES live in kernels alone and cannot be passed to or from Python.

`a + b`, `a - b`, `a * b`, `a / b`, `-a` take lanes and scalars; comparisons give a MASK, which `&` and `|` join.
"""

import operator
from typing import Any

from llvmlite import ir

from .kernels import numba, written

types, templates = numba.core.types, numba.core.typing.templates
register_model = numba.extending.register_model
lower_builtin, lower_cast = numba.extending.lower_builtin, numba.extending.lower_cast
models = numba.extending.models


def intrinsic(*function: Any, **options: Any) -> Any:
    """numba's decorator. What it makes takes no typing context, which a type checker cannot know."""
    return numba.extending.intrinsic(*function, **options)


COUNT = 16
_FLOAT, _INT = ir.FloatType(), ir.IntType(32)
_QUARTER = ir.VectorType(_FLOAT, 4)
_VECTOR, _INTS, _BITS = ir.VectorType(_FLOAT, COUNT), ir.VectorType(_INT, COUNT), ir.VectorType(ir.IntType(1), COUNT)


class _Lanes(types.Type):
    def __init__(self):
        super().__init__(name="Lanes")


class _Mask(types.Type):
    def __init__(self):
        super().__init__(name="Mask")


LANES, MASK = _Lanes(), _Mask()


@register_model(_Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, _VECTOR)


@register_model(_Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, _BITS)


def _constant(vector_type, values):
    return ir.Constant(vector_type, [ir.Constant(vector_type.element, value) for value in values])


def _spread(builder, scalar):
    first = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), scalar, ir.Constant(_INT, 0))
    return builder.shuffle_vector(first, ir.Constant(_VECTOR, ir.Undefined), _constant(_INTS, [0] * COUNT))


@lower_cast(types.Float, LANES)
@lower_cast(types.Integer, LANES)
def _cast(context, builder, fromty, toty, value):
    return _spread(builder, context.cast(builder, value, fromty, types.float32))


def _operator(function, kind, result, build, operands=2):
    """Gives a Python operator a meaning for lanes, or for masks."""
    scalars = (types.Float, types.Integer) if kind == LANES else ()

    @templates.infer_global(function)
    class _Typing(templates.AbstractTemplate):
        def generic(self, args, kws):
            if len(args) == operands and kind in args and all(a == kind or isinstance(a, scalars) for a in args):
                return templates.signature(result, *[kind] * operands)
            return None

    @lower_builtin(function, *[kind] * operands)
    def _lowered(context, builder, sig, args):
        return build(builder, *args)


for _function, _build in (
    (operator.add, ir.IRBuilder.fadd),
    (operator.sub, ir.IRBuilder.fsub),
    (operator.mul, ir.IRBuilder.fmul),
    (operator.truediv, ir.IRBuilder.fdiv),
):
    _operator(_function, LANES, LANES, _build)
_operator(operator.neg, LANES, LANES, ir.IRBuilder.fneg, operands=1)
for _function, _sign in ((operator.lt, "<"), (operator.gt, ">"), (operator.le, "<="), (operator.ge, ">=")):
    _operator(_function, LANES, MASK, lambda builder, a, b, sign=_sign: builder.fcmp_ordered(sign, a, b))
_operator(operator.and_, MASK, MASK, ir.IRBuilder.and_)
_operator(operator.or_, MASK, MASK, ir.IRBuilder.or_)


def _call(builder, name, result, args):
    function = builder.module.declare_intrinsic(name, (), ir.FunctionType(result, [a.type for a in args]))
    return builder.call(function, args)


def _place(context, builder, sig, args, array, indices, kind=types.float32):
    """Address of an element of an array."""
    if sig.args[array].layout != "C" or sig.args[array].dtype != kind:
        raise numba.core.errors.TypingError(f"lanes are of contiguous {kind}, not of {sig.args[array]}")
    made = context.make_array(sig.args[array])(context, builder, args[array])
    whole = [context.cast(builder, args[i], sig.args[i], types.intp) for i in indices]
    offset = whole[0]
    if len(whole) == 2:
        columns = builder.extract_value(made.shape, 1)
        offset = builder.add(builder.mul(offset, columns), whole[1])
    return builder.gep(made.data, [offset])


def _as_vector(builder, address):
    return builder.bitcast(address, _VECTOR.as_pointer())


def _reads(*indices):
    """Loads 16 elements of an array, the first argument, from the place on that these arguments name."""

    def build(context, builder, sig, args):
        return builder.load(_as_vector(builder, _place(context, builder, sig, args, 0, indices)), align=4)

    return build


def _writes(*indices, value):
    """Stores 16 elements, argument `value`, likewise."""

    def build(context, builder, sig, args):
        builder.store(args[value], _as_vector(builder, _place(context, builder, sig, args, 0, indices)), align=4)
        return context.get_dummy_value()

    return build


@intrinsic
def spread(typingctx, scalar):
    """The scalar in every lane."""
    return LANES(scalar), lambda context, builder, sig, args: _cast(context, builder, sig.args[0], LANES, args[0])


@intrinsic
def load(typingctx, array, i):
    """16 elements of a one-dimensional array, from i on."""
    return LANES(array, i), _reads(1)


@intrinsic
def load_row(typingctx, array, row, column):
    """16 elements of a row of a two-dimensional array, from `column` on."""
    return LANES(array, row, column), _reads(1, 2)


def _quarters(context, builder, sig, args):
    """Addresses of four rows of 4 elements: `at`, and from there on by `stride`, in a one-dimensional array."""
    first = _place(context, builder, sig, args, 0, (1,))
    stride = context.cast(builder, args[2], sig.args[2], types.intp)
    rows = [builder.gep(first, [builder.mul(stride, ir.Constant(stride.type, k))]) for k in range(4)]
    return [builder.bitcast(row, _QUARTER.as_pointer()) for row in rows]


@intrinsic
def load_square(typingctx, array, at, stride):
    """4 x 4 elements, row by row: 4 from `at` on, and from `stride`, 2 `stride`, 3 `stride` behind it."""

    def build(context, builder, sig, args):
        rows = [builder.load(address, align=4) for address in _quarters(context, builder, sig, args)]
        eight = ir.VectorType(_INT, 8)
        upper = builder.shuffle_vector(rows[0], rows[1], _constant(eight, range(8)))
        lower = builder.shuffle_vector(rows[2], rows[3], _constant(eight, range(8)))
        return builder.shuffle_vector(upper, lower, _constant(_INTS, range(COUNT)))

    return LANES(array, at, stride), build


@intrinsic
def store_square(typingctx, array, at, stride, value):
    """Writes 4 x 4 elements, row by row, as `load_square` reads them."""

    def build(context, builder, sig, args):
        four = ir.VectorType(_INT, 4)
        for k, address in enumerate(_quarters(context, builder, sig, args)):
            row = builder.shuffle_vector(args[3], args[3], _constant(four, range(4 * k, 4 * k + 4)))
            builder.store(row, address, align=4)
        return context.get_dummy_value()

    return types.void(array, at, stride, LANES), build


@intrinsic
def load_some(typingctx, array, row, column, mask):
    """Those elements of 16 of a row that the mask names, and 0; nothing else is touched."""

    def build(context, builder, sig, args):
        address = _as_vector(builder, _place(context, builder, sig, args, 0, (1, 2)))
        arguments = [address, ir.Constant(_INT, 4), args[3], _constant(_VECTOR, [0.0] * COUNT)]
        kind = ir.FunctionType(_VECTOR, [a.type for a in arguments])
        return builder.call(builder.module.declare_intrinsic("llvm.masked.load.v16f32.p0", (), kind), arguments)

    return LANES(array, row, column, mask), build


@intrinsic
def store(typingctx, array, i, value):
    """Writes 16 elements of a one-dimensional array."""
    return types.void(array, i, LANES), _writes(1, value=2)


@intrinsic
def store_whole(typingctx, array, i, value):
    """Writes 16 whole numbers, each smaller than 2³¹, into a one-dimensional array of int32."""

    def build(context, builder, sig, args):
        address = builder.bitcast(_place(context, builder, sig, args, 0, (1,), types.int32), _INTS.as_pointer())
        builder.store(builder.fptosi(args[2], _INTS), address, align=4)
        return context.get_dummy_value()

    return types.void(array, i, LANES), build


@intrinsic
def store_row(typingctx, array, row, column, value):
    """Writes 16 elements of a row of a two-dimensional array."""
    return types.void(array, row, column, LANES), _writes(1, 2, value=3)


@intrinsic
def store_some(typingctx, array, row, column, value, mask):
    """Writes those of 16 elements of a row that the mask names."""

    def build(context, builder, sig, args):
        address = _as_vector(builder, _place(context, builder, sig, args, 0, (1, 2)))
        arguments = [args[3], address, ir.Constant(_INT, 4), args[4]]
        kind = ir.FunctionType(ir.VoidType(), [a.type for a in arguments])
        builder.call(builder.module.declare_intrinsic("llvm.masked.store.v16f32.p0", (), kind), arguments)
        return context.get_dummy_value()

    return types.void(array, row, column, LANES, mask), build


@intrinsic
def fma(typingctx, a, b, c):
    """a b + c, rounded once."""
    sig = LANES(LANES, LANES, LANES)
    return sig, lambda context, builder, sig, args: _call(builder, "llvm.fma.v16f32", _VECTOR, args)


@intrinsic
def sqrt(typingctx, a):
    """Square root."""
    return LANES(LANES), lambda context, builder, sig, args: _call(builder, "llvm.sqrt.v16f32", _VECTOR, args)


@intrinsic
def floor(typingctx, a):
    """Largest whole number that is not larger."""
    return LANES(LANES), lambda context, builder, sig, args: _call(builder, "llvm.floor.v16f32", _VECTOR, args)


@intrinsic
def magnitude(typingctx, a):
    """Absolute value."""
    return LANES(LANES), lambda context, builder, sig, args: _call(builder, "llvm.fabs.v16f32", _VECTOR, args)


@intrinsic
def smaller(typingctx, a, b):
    """The smaller of each two; b where one is NaN."""

    def build(context, builder, sig, args):
        return builder.select(builder.fcmp_ordered("<", *args), *args)

    return LANES(LANES, LANES), build


@intrinsic
def larger(typingctx, a, b):
    """The larger of each two; b where one is NaN."""

    def build(context, builder, sig, args):
        return builder.select(builder.fcmp_ordered(">", *args), *args)

    return LANES(LANES, LANES), build


@intrinsic
def where(typingctx, mask, a, b):
    """a in the lanes that the mask names, b in the others."""
    return LANES(MASK, LANES, LANES), lambda context, builder, sig, args: builder.select(*args)


@intrinsic
def bits(typingctx, mask):
    """The mask as a whole number, lane 0 its lowest bit; 0 where it names none."""

    def build(context, builder, sig, args):
        return builder.zext(builder.bitcast(args[0], ir.IntType(COUNT)), ir.IntType(64))

    return types.int64(MASK), build


@intrinsic
def lowest(typingctx, number):
    """Place of the lowest bit that is set in an int64 that is not 0."""

    def build(context, builder, sig, args):
        return builder.cttz(args[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.int64), build


@intrinsic
def numbers(typingctx):
    """0, 1, ... 15."""
    return LANES(), lambda context, builder, sig, args: _constant(_VECTOR, [float(i) for i in range(COUNT)])


@intrinsic
def times_power(typingctx, a, shifted):
    """a 2^n, where `shifted` is n + 1.5 · 2²³ in floating point: its lowest bits are n."""

    def build(context, builder, sig, args):
        power = builder.shl(builder.bitcast(args[1], _INTS), _constant(_INTS, [23] * COUNT))
        return builder.bitcast(builder.add(builder.bitcast(args[0], _INTS), power), _VECTOR)

    return LANES(LANES, LANES), build


@intrinsic
def exponent(typingctx, a):
    """Whole part of log2 of positive normal numbers."""

    def build(context, builder, sig, args):
        raised = builder.lshr(builder.bitcast(args[0], _INTS), _constant(_INTS, [23] * COUNT))
        return builder.sitofp(builder.sub(raised, _constant(_INTS, [127] * COUNT)), _VECTOR)

    return LANES(LANES), build


@intrinsic
def mantissa(typingctx, a):
    """Positive normal numbers, divided by 2^exponent: in [1, 2)."""

    def build(context, builder, sig, args):
        kept = builder.and_(builder.bitcast(args[0], _INTS), _constant(_INTS, [0x007FFFFF] * COUNT))
        return builder.bitcast(builder.or_(kept, _constant(_INTS, [0x3F800000] * COUNT)), _VECTOR)

    return LANES(LANES), build


@intrinsic(prefer_literal=True)
def shifted(typingctx, a, b, by):
    """The 16 lanes from `by` on of a and b one behind the other; `by` is a literal."""
    first = by.literal_value

    def build(context, builder, sig, args):
        return builder.shuffle_vector(args[0], args[1], _constant(_INTS, range(first, first + COUNT)))

    return LANES(LANES, LANES, by), build


@intrinsic
def sums(typingctx, vectors):
    """Lane j is the sum of the lanes of vector j of a tuple of 8 or 9, the others 0; halves are added to halves."""
    count = len(vectors)
    if count not in (8, 9):
        raise numba.core.errors.TypingError("sums of 8 or 9 vectors")

    def build(context, builder, sig, args):
        left = [builder.extract_value(args[0], j) for j in range(count)]
        ninth = left.pop() if count == 9 else _constant(_VECTOR, [0.0] * COUNT)
        for width in (8, 4, 2):
            half = len(left) // 2
            left = [_folded(builder, left[j], left[j + half], width) for j in range(half)]
            swapped = [(lane + width) % COUNT for lane in range(COUNT)]
            ninth = builder.fadd(ninth, builder.shuffle_vector(ninth, ninth, _constant(_INTS, swapped)))
        # Now two lanes a sum: of the eight in the order of their numbers' bits, of the ninth in every pair.
        even = [*range(0, COUNT, 2), *[COUNT] * 8]
        odd = [*range(1, COUNT, 2), *[COUNT + 1] * 8]
        both = [builder.shuffle_vector(left[0], ninth, _constant(_INTS, lanes)) for lanes in (even, odd)]
        kept = _constant(_BITS, [1] * count + [0] * (COUNT - count))
        return builder.select(kept, builder.fadd(*both), _constant(_VECTOR, [0.0] * COUNT))

    return LANES(vectors), build


def _folded(builder, a, b, width):
    """Of groups of 2 `width` lanes, the halves added; the group of b goes behind that of a."""
    low, high = [], []
    for group in range(0, COUNT, 2 * width):
        for vector in (0, COUNT):
            low += range(vector + group, vector + group + width)
            high += range(vector + group + width, vector + group + 2 * width)
    return builder.fadd(
        builder.shuffle_vector(a, b, _constant(_INTS, low)), builder.shuffle_vector(a, b, _constant(_INTS, high))
    )


@written
def aligned(array):
    """The first place of a float32 array at which a vector lies in one cache line; `array` has 16 elements to spare."""
    return (-(array.ctypes.data >> 2)) & (COUNT - 1)
