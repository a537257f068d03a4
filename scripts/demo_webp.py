"""Make docs/images/demo.webp, the moving image of the README, of the video that `make demo` writes.

    python scripts/demo_webp.py [--video demo-out/demo.mp4] [--out docs/images/demo.webp]

Run it after scripts/choose_demo.py and `make demo`.
"""

from __future__ import annotations

import argparse
import subprocess
from pathlib import Path

import imageio_ffmpeg

ROOT = Path(__file__).parents[1]
WIDTH = 800  # pixels
QUALITY = 45  # of 100
MAX_BYTES = 2_000_000


def main() -> None:
    """Write the image."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--video", type=Path, default=ROOT / "demo-out" / "demo.mp4")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "images" / "demo.webp")
    args = parser.parse_args()
    if not args.video.is_file():
        parser.error(f"no video {args.video}; make demo writes it")
    encode(args.video, args.out)
    size = args.out.stat().st_size
    print(f"{args.out}: {size / 1e6:.2f} MB")
    if size > MAX_BYTES:
        parser.error(f"more than {MAX_BYTES / 1e6:g} MB; lower WIDTH or QUALITY")


def encode(video: Path, out: Path) -> None:
    """Encode a video as an animated WebP that repeats."""
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-v", "error", "-i", str(video)]
    command += ["-vf", f"scale={WIDTH}:-2:flags=area", "-c:v", "libwebp_anim"]
    command += ["-quality", str(QUALITY), "-loop", "0", str(out)]
    subprocess.run(command, check=True)


if __name__ == "__main__":
    main()
