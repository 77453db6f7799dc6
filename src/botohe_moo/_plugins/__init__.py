"""What other packages bring, by name or by path, and the parameters that all factories declare."""
