"""The best trail of one robot, by beam search."""
