"""The numbers this project claims, measured: ``make bench``."""
