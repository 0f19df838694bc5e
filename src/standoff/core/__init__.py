"""The nouns and the maths; imports nothing else of standoff."""
