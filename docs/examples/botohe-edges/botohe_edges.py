"""Edge lists in one CSV file, as missions."""

import csv
import io

from botohe_moo import Mission
from botohe_moo.mission import Draft, Format, Row, Source

COLUMNS = ["from", "to", "p_loss", "reward"]


def is_edge_list(source: Source) -> bool:
    """Tell by the first line whether a CSV file is an edge list."""
    return source.text.partition("\n")[0].strip() == ",".join(COLUMNS)


def read_edge_list(source: Source, *, per_cent: bool = False) -> Draft:
    """Read a line as an arc, and its reward as that of the node it leads to.

    With ``per_cent``, losses are percentages.
    """
    if not is_edge_list(source):
        raise ValueError(f"expected a first line {','.join(COLUMNS)}")
    nodes: dict[str, Row] = {}
    arcs, faults = [], []
    lines = csv.DictReader(source.text.splitlines())
    for line in lines:
        where = f"line {lines.line_num}"
        ends = line["from"], line["to"]
        for label in ends:
            nodes.setdefault(label, Row(where, (label,), {}))
        if line["reward"]:
            nodes[line["to"]].attributes["reward"] = line["reward"]
        arc = Row(where, ends, {})
        if line["p_loss"]:
            try:
                loss = float(line["p_loss"]) / (100 if per_cent else 1)
                arc.attributes["survival"] = 1 - loss
            except ValueError:
                found = line["p_loss"]
                faults.append(f"{where}: expected p_loss, got {found!r}")
        arcs.append(arc)
    return Draft([*nodes.values()], arcs, faults=faults)


def write_edge_list(mission: Mission) -> bytes:
    """Write the arcs; what an edge list has no column for is lost."""
    if not mission.is_plain:
        raise ValueError("an edge list has no kinds of robots")
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    rewards = mission.graph.nodes(data="reward")
    for tail, head, survival in mission.graph.edges(data="survival"):
        writer.writerow([tail, head, 1 - survival, rewards[head]])
    return text.getvalue().encode()


EDGE_LIST = Format((".csv",), is_edge_list, read_edge_list, write_edge_list)
