"""The live session as a camera of a MAVLink ground station."""
