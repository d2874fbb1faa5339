"""What the solution is worth: residuals, outliers, weak directions and why, carried points."""
