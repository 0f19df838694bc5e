"""What lies beyond the fence."""
