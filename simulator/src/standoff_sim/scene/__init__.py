"""What a site is made of, who works there, and where everything stands at a moment."""
