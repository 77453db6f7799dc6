"""Merging the results that several machines have of one study."""

import dataclasses
import json
import os
from collections.abc import Sequence
from pathlib import Path

from botohe_moo.base.files import read_bytes, replace_file
from botohe_moo.study.file.config import Seeds
from botohe_moo.study.file.model import MANIFEST, Study, StudyError, study_folder
from botohe_moo.study.planning import refresh_tables
from botohe_moo.study.store.folder import PARTS, StudyFolder, restore_study, writing
from botohe_moo.study.store.tables import StudyTables


def merge_studies(
    folders: Sequence[str | os.PathLike[str]], out: str | os.PathLike[str] | None = None
) -> StudyTables:
    """Make one study from the results of it on several machines.

    Their study files are the same but for the seeds, and the merged study has all of these. Where
    several folders have the same run, ``out`` keeps its own, or else gets that of the first folder.

    Parameters
    ----------
    folders
        Folders of the study, at least two.
    out
        Folder to write to: a new or empty one, or one with this study, such as one of ``folders``.
        Default: ``results/NAME``.

    Raises
    ------
    StudyError
        If a folder holds no study, or another one than the first folder does. Also if the file of a
        run is damaged, or ``out`` cannot be used or written to.

    Examples
    --------
    >>> from botohe_moo.study import merge_studies, run_study
    >>> trial = {
    ...     "name": "trial",
    ...     "missions": ["toy"],
    ...     "algorithms": ["greedy"],
    ...     "budget": {"evaluations": 50},
    ...     "seeds": [1],
    ... }
    >>> first = run_study(trial, "one")
    >>> second = run_study({**trial, "seeds": [2]}, "two")
    >>> merge_studies(["one", "two"], "both").runs["seed"].tolist()
    [1, 2]
    """
    if len(folders) < 2:
        raise StudyError(f"Expected at least two folders to merge, got {len(folders)}.")
    paths = [Path(folder) for folder in folders]
    first = restore_study(paths[0])
    target = StudyFolder(study_folder(first.name, out))
    if (target.path / MANIFEST).exists():
        paths.append(target.path)
    studies = {path: restore_study(path) for path in paths}
    for path, study in studies.items():
        if differing := _difference(first, study):
            raise StudyError(
                f"{path}: not the study in {paths[0]}; expected the same study but for its seeds, "
                f"found differences in {differing}."
            )
    study = _with_seeds(first, {seed for study in studies.values() for seed in study.seeds})
    with target.locked(study):
        target.write_study(study)
        with writing(target.path):
            for path in paths:
                _copy_results(path, target.path)
        return refresh_tables(study, target)


def _difference(one: Study, other: Study) -> str:
    """Return in words where two studies differ besides their seeds; empty if nowhere."""
    first, second = (study.file.model_dump(exclude={"seeds"}) for study in (one, other))
    if keys := [key for key, value in first.items() if second[key] != value]:
        return " and ".join(keys)
    # Equal files may name different missions by the same name, or code of different versions.
    if _digests_for_one_seed(one) != _digests_for_one_seed(other):
        return "the missions that it names, or in versions"
    return ""


def _digests_for_one_seed(study: Study) -> list[str]:
    return [run.digest for run in dataclasses.replace(study, seeds=(0,)).runs()]


def _with_seeds(study: Study, seeds: set[int]) -> Study:
    """Return a study with other seeds, and with its file changed accordingly."""
    values = sorted(seeds)
    file = study.file.model_copy(update={"seeds": Seeds(values=values)})
    # JSON is YAML, too, and never takes a text for a number.
    text = json.dumps(file.model_dump(mode="json", exclude_defaults=True), indent=1)
    return dataclasses.replace(study, file=file, text=f"{text}\n", seeds=tuple(values))


def _copy_results(source: Path, target: Path) -> None:
    """Copy the files of runs, failures, missions and bounds that are not there yet."""
    for part in PARTS:
        for path in sorted((source / part).glob("[!.]*")):
            copy = target / part / path.name
            if not copy.exists():
                replace_file(copy, read_bytes(path))
