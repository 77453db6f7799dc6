"""The engines, which know nothing of pymoo."""
