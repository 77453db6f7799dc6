"""Valid files, which the package itself has written, to be changed."""

import tempfile
from dataclasses import replace
from functools import cache
from itertools import combinations_with_replacement
from pathlib import Path

import moocore
import networkx as nx
import numpy as np

import botohe_moo.mission
from botohe_moo import decide, load_mission
from botohe_moo.mission import Mission, save_mission
from botohe_moo.search.bounds import FrontBound
from botohe_moo.search.bounds.record import Line, Step
from botohe_moo.solution import Solution
from botohe_moo.study import Study, load_study, make_tables
from botohe_moo.study.file.model import Run
from botohe_moo.study.run.task import Outcome, Record, failure
from botohe_moo.study.store.folder import StudyFolder
from botohe_moo.trails import PlanBatch, TrailPlan
from tests.study.made import ENVIRONMENT

ROOT = Path(__file__).parents[2]
DATA = ROOT / "tests" / "data"
TOYS = Path(botohe_moo.mission.__file__).parent / "data" / "toy.json"

Files = dict[str, bytes]  # by path in the folder of an input


def read_files(folder: Path, *endings: str) -> Files:
    """Read the files of a folder and of those in it, by their path there."""
    files = {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.suffix in endings
    }
    assert files
    return files


def toy(robots: int = 2) -> Mission:
    return load_mission("toy", robots=robots)


def toy_front(robots: int = 2) -> tuple[tuple[TrailPlan, ...], np.ndarray]:
    """Give plans on the toy mission of which none is better than another, by descending reward."""
    mission = toy(robots)
    base = mission.base
    to_and_fro = [
        [base, node, base] for node in mission.nodes if mission.graph.has_edge(base, node)
    ]
    ways = [[base], *to_and_fro, [node for way in to_and_fro for node in way[:-1]] + [base]]
    teams = combinations_with_replacement(ways, robots)
    plans = [mission.plan(trails) for trails in teams]
    objectives, first = np.unique(mission.evaluate(plans), axis=0, return_index=True)
    kept = np.flatnonzero(moocore.is_nondominated(objectives, maximise=True))[::-1]
    return tuple(plans[first[i]] for i in kept), objectives[kept]


@cache
def node_links() -> list[Files]:
    named = [DATA / "pier.json", TOYS]
    return [{"mission.json": path.read_bytes()} for path in named]


@cache
def graphmls() -> list[Files]:
    """One by Gephi's hand, and one that is ours."""
    mission = toy()
    graph = nx.relabel_nodes(
        nx.DiGraph(mission.graph), {node: f"n{node}" for node in mission.nodes}
    )
    ours = Mission(graph, base=f"n{mission.base}")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "mission.graphml")
        save_mission(ours, path)
        return [{path.name: path.read_bytes()}, {path.name: (DATA / "gephi.graphml").read_bytes()}]


@cache
def benchmarks() -> list[Files]:
    return [{"mission.txt": (DATA / "points.txt").read_bytes()}]


@cache
def tables() -> list[Files]:
    nodes = b"label,reward,x,y,zone\ndock,0,0,0,\nreef,5,1,0.5,north\nwreck,2.5,,,south\n"
    arcs = b"tail,head,survival,length\ndock,reef,0.9,2\nreef,wreck,0.8,\ndock,wreck,1,3.5\n"
    semicolons = nodes.replace(b",", b";"), arcs.replace(b",", b";")
    return [
        {"nodes.csv": nodes, "arcs.csv": arcs},
        dict(zip(("nodes.csv", "arcs.csv"), semicolons, strict=True)),
    ]


@cache
def study_files() -> list[Files]:
    guide = (ROOT / "docs" / "studies.md").read_text("utf-8").split("```yaml\n")[1]
    texts = [path.read_bytes() for path in sorted((ROOT / "experiments").glob("*.yaml"))]
    texts.append(guide.split("```")[0].encode())
    return [{"study.yaml": text, "sites/mine.json": TOYS.read_bytes()} for text in texts]


@cache
def solutions() -> list[Files]:
    """What ``Solution.write`` writes, but for pictures, which nobody reads."""
    found = []
    for robots in (2, 3):
        plans, objectives = toy_front(robots)
        solution = Solution(
            mission=toy(robots),
            plans=plans,
            objectives=objectives,
            algorithm="random",
            parameters={"pop_size": 5},
            seed=1,
            evaluations=100,
            seconds=0.5,
            interrupted=False,
            source={"name_or_path": "toy", "robots": robots},
            max_length=None if robots == 2 else 50.0,
        )
        with tempfile.TemporaryDirectory() as folder:
            solution._write_tables(Path(folder))
            found.append(read_files(Path(folder), ".json", ".csv"))
    return found


@cache
def bounds() -> list[Files]:
    found = []
    for robots in (2, 3):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "bound.json")
            toy_bound(robots).save(path)
            found.append({path.name: path.read_bytes()})
    return found


def toy_bound(robots: int) -> FrontBound:
    """Give a bound on the toy mission that is true, if not much of one."""
    mission = toy(robots)
    moving = range(1, robots + 1)
    most = mission.total_reward
    return FrontBound(
        mission=mission,
        lines=tuple(
            line
            for n in moving
            for line in (Line(n, most, 0.0, "everything"), Line(n, 9 * most, most, "relaxed"))
        ),
        steps=tuple(Step(n, most, 0.1 * i, "front") for n in moving for i in range(3)),
        most_survival=1.0,
        min_survival=0.0,
        max_length=np.inf,
        seconds=2.0,
        notes=("made up",),
    )


@cache
def plans() -> list[Files]:
    """What ``write_plan`` writes."""
    mission, (some, _) = toy(), toy_front()
    return [{"plan.json": decide.plan_json(mission, plan).encode()} for plan in some[:2]]


def toy_study() -> Study:
    return load_study(
        {
            "name": "trial",
            "title": "Two on two",
            "missions": {"toy": "toy", "trio": {"mission": "toy", "robots": 3}},
            "algorithms": {
                "A": "random",
                "B": {"algorithm": "nsga2", "grid": {"pop_size": [4, 6]}},
            },
            "budget": {"evaluations": 50},
            "seeds": 2,
            "bounds": {"seconds": 2},
        }
    )


def _outcome(run: Run) -> Outcome:
    """Give an outcome whose front grows: what an algorithm might have found."""
    plans, objectives = toy_front(run.mission.mission.robots)
    n = len(plans) - (run.seed + len(run.algorithm.label)) % 2
    batch = PlanBatch.from_plans(plans[:n], run.mission.mission.robots)
    first = Record(5, 0.01, objectives[-1:], 0)
    last = Record(50, 0.2, objectives[:n], 0, (batch, objectives[:n]))
    return Outcome(
        *("done", "evaluations", 50, 0.25, 0.01),
        records=(first, last),
        environment=ENVIRONMENT,
        began="2026-11-22T04:30:12Z",
    )


@cache
def studies() -> list[Files]:
    """The folder of a study of twelve runs, of which one has failed and one is missing."""
    study = toy_study()
    with tempfile.TemporaryDirectory() as name:
        folder = StudyFolder(name)
        with folder.locked(study):
            folder.write_study(study)
            *runs, failed, _ = study.runs()
            for run in runs:
                folder.save(run, _outcome(run))
            broken = failure("it broke", "Traceback: made up")
            folder.save(failed, replace(broken, environment=ENVIRONMENT))
            for mission in study.missions:
                folder.save_bound(mission, toy_bound(mission.mission.robots), 2.0)
        make_tables(name)
        # CSV files are for people: a folder is whole without them.
        return [read_files(Path(name), ".json", ".yaml", ".npz", ".parquet")]


@cache
def stored_runs() -> list[Files]:
    (files,) = studies()
    return [{name: data} for name, data in files.items() if name.endswith(".npz")]
