"""What pictures and charts are made with, whoever makes them: colours, text, lines, ground, films. Nothing of a run."""
