"""What `posed profile` measures, and how it is shown."""
