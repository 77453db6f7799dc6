"""What runs are worth: indicators and statistics."""
