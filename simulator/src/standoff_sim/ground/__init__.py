"""The ground of a site: its heights, soils and marks, and how they look from above."""
