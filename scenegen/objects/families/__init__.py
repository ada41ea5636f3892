"""Built-in classes of everyday objects, each with many members, as unit shapes."""
