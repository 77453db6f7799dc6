"""What operators share: their parts, and drawing one of several."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Generic, TypeVar

import numpy as np

from botohe_moo._base.checks import check_number
from botohe_moo._base.types import OffsetArray, Rng

Part = TypeVar("Part")


def check_part(name: str, part: Part | None, kind: type[Part], default: type[Part]) -> Part:
    """Return a part of an operator, by default a new one; a TypeError if it is of another kind."""
    if part is not None and not isinstance(part, kind):
        raise TypeError(f"Expected {name} to be a {kind.__name__}, got {part!r}.")
    return default() if part is None else part


class Mixture(Generic[Part]):
    """Several operators, one of which is drawn for each plan.

    ``parts`` are operators of the class ``kind``, or a mapping from them to weights above 0.
    Messages call an operator a ``what``.
    """

    def __init__(
        self, what: str, kind: type[Any], parts: Sequence[Part] | Mapping[Part, float]
    ) -> None:
        if isinstance(parts, str) or not isinstance(parts, Iterable):
            raise TypeError(
                f"Expected a sequence of {kind.__name__}s or a mapping from them to weights, got "
                f"{parts!r}."
            )
        self.parts: tuple[Part, ...] = tuple(parts)
        if not self.parts:
            raise ValueError(f"Expected at least one {what}, got none.")
        for part in self.parts:
            if not isinstance(part, kind):
                raise TypeError(f"Expected a {what} to be a {kind.__name__}, got {part!r}.")
        weights = parts.values() if isinstance(parts, Mapping) else [1.0] * len(self.parts)
        name = f"weight of a {what}"
        self.weights = np.array([check_number(name, weight, above=0) for weight in weights])

    def draw(self, rng: Rng, n: int) -> list[tuple[Part, OffsetArray]]:
        """Draw an operator for each of ``n`` plans; return those drawn, with the plans' indices."""
        drawn = rng.choice(len(self.parts), n, p=self.weights / self.weights.sum())
        return [(self.parts[i], np.flatnonzero(drawn == i)) for i in np.unique(drawn)]
