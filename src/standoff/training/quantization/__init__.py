"""Smaller models: int8 where accuracy allows it, weights in half precision."""
