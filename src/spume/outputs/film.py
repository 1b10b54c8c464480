"""Films: pictures one after the other, as an MP4 where ffmpeg is to be had, or as a GIF."""

from __future__ import annotations

import contextlib
import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

FRAMES_PER_SECOND = 15


def ffmpeg() -> str | None:
    """Return the path of ffmpeg: that of the system, or of the extra ``view``; None without one."""
    found = shutil.which("ffmpeg")
    if found is not None:
        return found
    try:
        import imageio_ffmpeg

        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        return None


def write_gif(images: Iterable[NDArray[np.uint8]], path: Path, colours: Any) -> None:
    """Write an endless GIF.

    Args:
        images: RGB pictures of one size, shape (height, width, 3).
        path: the file.
        colours: matplotlib's colour map of the pictures, which the palette must hold well.
    """
    from PIL import Image

    all_images = list(images)
    # One palette for all, from the first, the middle and the last picture: no flicker.
    # The colour scale is given weight, or much white would leave it few colours.
    some = [all_images[i] for i in sorted({0, len(all_images) // 2, len(all_images) - 1})]
    width = some[0].shape[1]
    scale = (colours(np.linspace(0.0, 1.0, width))[:, :3] * 255.0 + 0.5).astype(np.uint8)
    some.append(np.broadcast_to(scale, (some[0].shape[0], width, 3)))
    palette = Image.fromarray(np.concatenate(some)).quantize(
        colors=255, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE
    )
    entries = np.array(palette.getpalette()).reshape(-1, 3)
    entries[entries.min(axis=1) > 247] = 255  # white is white
    palette.putpalette(entries.reshape(-1).tolist())
    drawn = [Image.fromarray(i).quantize(palette=palette, dither=Image.Dither.NONE) for i in all_images]
    duration = [round(1000 / FRAMES_PER_SECOND)] * len(drawn)
    duration[-1] = 1500
    drawn[0].save(path, save_all=True, append_images=drawn[1:], duration=duration, loop=0)


def write_mp4(images: Iterable[NDArray[np.uint8]], path: Path) -> bool:
    """Write an mp4 with ffmpeg; return whether that went well.

    Args:
        images: RGB pictures of one size, shape (height, width, 3); of odd sizes the last row or column is left out.
        path: the file.
    """
    program = ffmpeg()
    if program is None:
        return False
    process: Any = None
    try:
        for image in images:
            even = np.ascontiguousarray(image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2])
            if process is None:
                size = f"{even.shape[1]}x{even.shape[0]}"
                options = f"-y -f rawvideo -pix_fmt rgb24 -s {size} -r {FRAMES_PER_SECOND} -i -"
                encoding = "-an -c:v libx264 -crf 20 -pix_fmt yuv420p -movflags +faststart"
                process = subprocess.Popen(
                    [program, *options.split(), *encoding.split(), str(path)],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                )
            process.stdin.write(even.tobytes())
    except OSError:  # ffmpeg gave up (no such encoder)
        pass
    if process is None:
        return False
    with contextlib.suppress(OSError):
        process.stdin.close()
    if process.wait() == 0:
        return True
    path.unlink(missing_ok=True)
    return False
