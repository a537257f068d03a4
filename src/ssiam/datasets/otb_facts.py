"""What the OTB benchmark's pages say about its sequences and its folders do not."""

from __future__ import annotations

# First and last image of the sequences whose boxes do not go with all images from 0001 on.
# Tiger1 has boxes from 0001 on, but the benchmark begins at 0006.
RANGES: dict[str, tuple[int, int]] = {
    "BlurCar1": (247, 988),
    "BlurCar3": (3, 359),
    "BlurCar4": (18, 397),
    "David": (300, 770),
    "Diving": (1, 215),
    "Football1": (1, 74),
    "Freeman3": (1, 460),
    "Freeman4": (1, 283),
    "Tiger1": (6, 354),
}

# The 50 harder ones of the 100 (TB-50); all others are in OTB100 only.
# fmt: off
OTB50: frozenset[str] = frozenset((
    "Basketball", "Biker", "Bird1", "BlurBody", "BlurCar2", "BlurFace", "BlurOwl", "Bolt", "Box",
    "Car1", "Car4", "CarDark", "CarScale", "ClifBar", "Couple", "Crowds", "David", "Deer", "Diving",
    "DragonBaby", "Dudek", "Football", "Freeman4", "Girl", "Human3", "Human4-2", "Human6", "Human9",
    "Ironman", "Jump", "Jumping", "Liquor", "Matrix", "MotorRolling", "Panda", "RedTeam", "Shaking",
    "Singer2", "Skating1", "Skating2-1", "Skating2-2", "Skiing", "Soccer", "Surfer", "Sylvester",
    "Tiger2", "Trellis", "Walking", "Walking2", "Woman",
))
# fmt: on
