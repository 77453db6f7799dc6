"""Relaxed trails, and exact ones: what no trail exceeds under given prices."""
