"""What every search stands on: compiling, random numbers, the graph, paths, evaluation, fronts."""
