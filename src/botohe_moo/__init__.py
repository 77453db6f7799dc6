"""Bi-objective team orienteering in hazardous environments (BOTOHE), for pymoo."""
