"""The commands: arguments, files, tables; the work is done by the library."""
