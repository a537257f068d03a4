"""Sources of a live session's frames. A feed delivers the newest frame and never queues."""
