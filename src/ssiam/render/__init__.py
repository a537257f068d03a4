"""Virtual cameras: views of the frames, computed from recorded motions and boxes."""
