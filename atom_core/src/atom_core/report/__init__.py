"""Results for people and programs: verdicts, tables, JSON, CSV, and the page in `page`."""
