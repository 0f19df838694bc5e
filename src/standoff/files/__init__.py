"""Files and folders that are whole at any moment; text, YAML and JSON, read and written in one way."""
