"""Plans in ragged arrays: evaluated, simulated, repaired, varied."""
