"""What a user would take instead: methods that compare two sensors at a time."""
