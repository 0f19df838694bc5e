"""Everything that stands on a site and is not named in the truth."""
