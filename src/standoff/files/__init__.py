"""Files and folders that are whole at any moment, and JSON that every reader accepts; for every package alike."""
