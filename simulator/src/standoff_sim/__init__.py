"""A construction site with exact truth: drone video whose every position, box and pixel is known."""
