"""pymoo's population-based algorithms with operators for trail plans."""
