"""Virtual cameras: how well a view follows its target, and how smoothly it moves."""
