"""Array types that annotations across the package share."""

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.integer[Any]]  # node and arc indices
OffsetArray: TypeAlias = NDArray[np.int64]  # where the pieces of a ragged array begin
SeedArray: TypeAlias = NDArray[np.uint64]
ObjectArray: TypeAlias = NDArray[Any]
Record: TypeAlias = Any  # a numpy.record, whose fields are attributes
RecordArray: TypeAlias = Any  # a numpy.recarray of these
BoolArray: TypeAlias = NDArray[np.bool_]
Rng: TypeAlias = np.random.Generator
