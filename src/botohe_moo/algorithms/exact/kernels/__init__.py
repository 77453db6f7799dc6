"""All trails and teams that may be on the Pareto front."""
