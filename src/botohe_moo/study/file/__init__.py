"""From a study file to the runs that it asks for."""
