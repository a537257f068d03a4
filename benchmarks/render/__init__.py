"""The stabilized view against the stabilizers of ffmpeg and vidstab."""
