"""What pictures share: canvas, fonts, labels, palettes."""
