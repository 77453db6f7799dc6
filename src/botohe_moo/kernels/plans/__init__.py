"""Plans in ragged arrays: evaluated, repaired, changed, varied."""
