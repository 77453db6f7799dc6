"""Ants that build plans, and the pheromone they leave."""
