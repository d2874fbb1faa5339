"""The data model: frozen, validated values that every other room of the library shares."""
