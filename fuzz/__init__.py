"""Hostile input for every command: what strangers may send must end in one line of error."""
