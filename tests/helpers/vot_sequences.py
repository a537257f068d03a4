"""Sequences in VOT's layout whose images are empty, for code that only lists them."""


def write_sequence(folder, frames):
    """Write the ground truth and `frames` empty images."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "groundtruth.txt").write_text("1,2,3,4\n" * frames)
    for number in range(1, frames + 1):
        (folder / f"{number:08d}.jpg").touch()
