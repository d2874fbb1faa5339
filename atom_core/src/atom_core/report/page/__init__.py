"""The report of a result as a page: numbers in, one self-contained HTML file and one PDF out."""
