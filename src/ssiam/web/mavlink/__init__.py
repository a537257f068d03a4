"""A live session as a MAVLink camera that tracks."""
