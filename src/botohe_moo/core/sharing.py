"""Named tuples that the helpers of a kernel share.

Numba hands a named tuple to a function array by array, and each array as seven numbers: most of the
code that it compiled was calls of helpers. ``shared`` hands over one address instead.
"""

from typing import Any, TypeVar

from numba import extending, types
from numba.core import cgutils, imputils
from numba.core.typing.templates import AttributeTemplate

Tuple = TypeVar("Tuple", bound=tuple[Any, ...])

_numba: Any = extending
_code: Any = cgutils
_made: Any = imputils
_Attributes: Any = AttributeTemplate
_Type: Any = types.Type


class _Shared(_Type):  # type: ignore[misc]
    """The address of a named tuple."""

    def __init__(self, named: Any) -> None:
        self.named = named
        super().__init__(name=f"shared({named})")

    def kind_of(self, name: str) -> types.Type:
        """Return the type of a field; a field that is a named tuple is shared, too."""
        field: types.Type = self.named[self.named.fields.index(name)]
        return _Shared(field) if isinstance(field, types.BaseNamedTuple) else field


@_numba.register_model(_Shared)
class _SharedModel(_numba.models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, models: Any, kind: _Shared) -> None:
        super().__init__(models, kind, models[kind.named].get_value_type().as_pointer())


@_numba.infer_getattr
class _Fields(_Attributes):  # type: ignore[misc]
    key = _Shared

    def generic_resolve(self, kind: _Shared, name: str) -> types.Type | None:
        return kind.kind_of(name) if name in kind.named.fields else None


def _read_field(context: Any, builder: Any, kind: _Shared, value: Any, name: str) -> Any:
    address = _code.gep_inbounds(builder, value, 0, kind.named.fields.index(name))
    field = kind.kind_of(name)
    read = address if isinstance(field, _Shared) else builder.load(address)
    return _made.impl_ret_borrowed(context, builder, field, read)  # kernels count who uses arrays


_numba.lower_getattr_generic(_Shared)(_read_field)


def shared(named: Tuple) -> Tuple:
    """Return the same named tuple, whose address is what a kernel hands to its helpers.

    Only for arguments of a kernel: its caller keeps their arrays as long as it runs. Arrays that
    the kernel makes would be freed too early, since users by address are not counted.
    """
    return named


def _type_shared(context: Any) -> Any:  # noqa: ARG001
    return lambda named: _Shared(named) if isinstance(named, types.BaseNamedTuple) else None


def _share(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
    return _code.alloca_once_value(builder, arguments[0])


_numba.type_callable(shared)(_type_shared)
_numba.lower_builtin(shared, types.BaseNamedTuple)(_share)
