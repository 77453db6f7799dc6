"""Draw the rooms of the package, and which imports which: ``python -m docs.architecture``."""

import re
from pathlib import Path

import grimp
import matplotlib.pyplot as plt
import networkx as nx

ENDS = {"min_source_margin": 12, "min_target_margin": 15}  # points around the boxes
DRAWING = Path(__file__).parent / "_static" / "architecture.svg"


def rooms() -> nx.DiGraph:
    """Return which room imports which, without what follows from other imports."""
    modules = grimp.build_graph("botohe_moo", exclude_type_checking_imports=True)
    found = nx.DiGraph()
    for importer in sorted(modules.modules):
        for imported in sorted(modules.find_modules_directly_imported_by(importer)):
            ends = [module.split(".")[1] for module in (importer, imported) if "." in module]
            if len({*ends}) == 2:
                found.add_edge(*ends)
    return nx.transitive_reduction(found)


def arrows(graph: nx.DiGraph) -> str:
    """Write a graph as text, which the drawing has as its description."""
    return ", ".join(f"{one} imports {other}" for one, other in sorted(graph.edges))


def drawn() -> str:
    """Return the arrows that the drawing shows."""
    return re.findall("<dc:description>(.*)</dc:description>", DRAWING.read_text("utf-8"))[0]


def main() -> None:
    """Write the drawing, which tells what it shows as its description."""
    graph = nx.DiGraph(sorted(rooms().edges))
    layers = {-i: sorted(layer) for i, layer in enumerate(nx.topological_generations(graph))}
    places = nx.multipartite_layout(graph, subset_key=layers, align="horizontal")
    plt.rcParams["svg.hashsalt"] = "rooms"  # the same drawing each time
    figure, ax = plt.subplots(figsize=(9, 10), layout="constrained")
    box = {"boxstyle": "round", "facecolor": "#eaf2f8", "edgecolor": "#33658a"}
    nx.draw_networkx_edges(graph, places, ax=ax, edge_color="#8a8f94", **ENDS)
    nx.draw_networkx_labels(graph, places, ax=ax, font_size=9, bbox=box)
    ax.axis("off")
    figure.savefig(DRAWING, metadata={"Date": None, "Description": arrows(graph)})


if __name__ == "__main__":
    main()
