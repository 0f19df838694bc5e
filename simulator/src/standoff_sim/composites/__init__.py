"""Rendered machines, people and clutter, laid with their shadows over photographs of real ground."""
