"""The drone and its camera: where it flies, what its sensor does to a picture, what it says of itself."""
