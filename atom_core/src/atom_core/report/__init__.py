"""Results for people: tables in plain text, CSV files."""
