"""Pictures of studies, one function each."""
