"""What is known of targets: weighted points with log odds, grids of them, and their axes."""
