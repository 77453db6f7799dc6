"""The files of bounds: ``DIGEST-SECONDS.json``, as ``FrontBound.save`` writes them."""

import hashlib
import math
from dataclasses import dataclass
from pathlib import Path

from botohe_moo._base.files import read_bytes
from botohe_moo.indicators import TIE
from botohe_moo.search.bounds import FrontBound
from botohe_moo.study.file.digest import canonical
from botohe_moo.study.file.model import StudyError, StudyMission


@dataclass(frozen=True)
class KeptBound:
    """A bound that was read from its file."""

    path: Path
    bound: FrontBound
    seconds: float  # that it was allowed; it may have ended before
    content: str  # digest of the file

    def check(self, mission: str, area: float) -> None:
        """Raise a StudyError if the runs on a mission have found a larger area than there is."""
        if area > self.bound.area + TIE:
            raise StudyError(
                f"{self.path}: not a bound: it says that no front has an area above "
                f"{self.bound.area:.6f}, but runs on {mission} have found {area:.6f}. Remove the "
                "file; running the study makes it again."
            )


def bound_file(folder: Path, mission: StudyMission, seconds: float) -> Path:
    """Give the file of a mission's bound that was allowed so many seconds."""
    return folder / f"{mission.bound_digest}-{canonical(seconds)}.json"


def bound_files(folder: Path, mission: StudyMission) -> list[Path]:
    """List the files of a mission's bounds, that with the most seconds first."""
    found = folder.glob(f"{mission.bound_digest}-*.json")
    return sorted((path for path in found if _seconds(path) > 0), key=_seconds, reverse=True)


def read_bound(path: Path, mission: StudyMission) -> KeptBound:
    """Read a bound; an OSError or a ValueError if it is not that of the mission and its limits."""
    bound = FrontBound.load(path, mission.mission)
    budget = math.inf if mission.max_length is None else mission.max_length
    if (bound.min_survival, bound.max_length) != (mission.min_survival, budget):
        raise ValueError("it bounds plans with other limits")
    content = hashlib.sha256(read_bytes(path)).hexdigest()[:16]
    return KeptBound(path, bound, _seconds(path), content)


def _seconds(path: Path) -> float:
    """Give the seconds in the name of a file; 0 if there are none."""
    try:
        return float(path.stem.partition("-")[2])
    except ValueError:
        return 0.0
