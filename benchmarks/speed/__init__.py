"""Time per frame, throughput and memory."""
