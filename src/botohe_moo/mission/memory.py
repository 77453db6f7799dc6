"""How much memory missions take, estimated before it is taken.

The limit is one for all machines, so that a study file is valid on each of them or on none.
"""

from botohe_moo._base.checks import ParameterError, quoted

_GIB = 2**30
_LIMIT = 8 * _GIB

# A mission takes about as much of the limit as its file is long, sixteen times.
MAX_FILE_BYTES = _LIMIT // 16

# Measured at the peak of making a mission, where its graph is copied and its arcs are sorted.
_NODE, _ARC, _PAIR = 2_000, 1_000, 24

# A search keeps the plans of its front, its population or its reserve: a thousand, and for every
# robot of each a dozen nodes, their offset and the bytes by which trails are compared.
_PLANS, _TRAIL = 1_000, 200

MAX_ROBOTS = _LIMIT // (_PLANS * _TRAIL)


def team_bytes(robots: int) -> int:
    """Estimate what a search for a team takes."""
    return _PLANS * _TRAIL * robots


def needed_bytes(nodes: int, arcs: int, pairs: int = 0) -> int:
    """Estimate what a mission takes while it is made, with arrays of pairs of nodes."""
    return _NODE * nodes + _ARC * arcs + _PAIR * pairs


def check_memory(
    name: str, value: int, *, nodes: int, arcs: int, pairs: int = 0, remedy: str = ""
) -> None:
    """Refuse a parameter with which a mission would take more memory than the limit.

    The mission has about that many nodes and arcs, and arrays hold ``pairs`` of nodes while it is
    made. The message says to lower ``remedy``, by default the parameter.
    """
    needed = needed_bytes(nodes, arcs, pairs)
    if needed > _LIMIT:
        raise ParameterError(
            f"Expected {name} of a mission that takes at most {in_gib(_LIMIT)} of memory, got "
            f"{quoted(value)}, which takes about {in_gib(needed)}; lower {remedy or name}.",
            name,
        )


def in_gib(n_bytes: int) -> str:
    """Give a number of bytes in GiB, for a message."""
    return f"{min(n_bytes, 2**1000) / _GIB:.3g} GiB"
