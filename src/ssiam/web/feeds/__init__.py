"""Where a live session takes its frames from: always the newest, never a queue."""
