"""One run, and the processes and clusters that perform runs."""
