"""Times and memory of rooms and questions: rendering, streams, and what their pictures hold."""
