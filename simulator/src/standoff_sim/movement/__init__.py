"""Where somebody is at a time, and how people and machines get there."""
