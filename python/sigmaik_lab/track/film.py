"""A short film of a run: the camera's pictures, beside pictures of the whole scene. Needs Pillow."""

from __future__ import annotations

import pathlib
from typing import TYPE_CHECKING, Any

import numpy as np

from sigmaik.files import write_atomically

from .stage import FILM

if TYPE_CHECKING:
    from .rendered import Seen

__all__ = ["save_film"]

_WIDTH = 640  #: [pixels]
_GREEN, _WHITE, _BLACK = (60, 220, 60), (255, 255, 255), (0, 0, 0)


def save_film(seen: Seen, file: pathlib.Path) -> pathlib.Path:
    """A GIF that plays at the run's pace. Green: the tag as found."""
    from PIL import Image, ImageDraw

    pictures: list[Any] = []
    e = seen.run.experiment
    for still in seen.stills:
        both = Image.fromarray(np.concatenate([still.picture, still.outside], axis=1))
        scale = _WIDTH / both.width
        both = both.resize((_WIDTH, round(scale * both.height)), Image.Resampling.BOX)
        pen = ImageDraw.Draw(both)
        if still.corners is not None:
            pen.polygon([(scale * float(x), scale * float(y)) for x, y in still.corners], outline=_GREEN, width=2)
        error = seen.run.position_error[min(len(e.poses) - 1, round(still.stamp * e.settings.rate))]
        text = (
            f"{still.stamp:4.1f} s   {'tag' if still.corners is not None else 'no tag'}   tip {1e3 * error:3.0f} mm off"
        )
        pen.rectangle([0, 0, _WIDTH // 2, 13], fill=_BLACK)
        pen.text((4, 1), text, fill=_WHITE)
        pictures.append(both.quantize(40, dither=Image.Dither.NONE))
    first, *others = pictures
    return write_atomically(
        file,
        lambda stream: first.save(
            stream, "GIF", save_all=True, append_images=others, duration=round(1000.0 / FILM), loop=0, optimize=True
        ),
    )
