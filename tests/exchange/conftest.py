import pytest

from ssiam.exchange import Annotation, Annotations

# 40x20 pixels about (100, 50), rotated by 30 degrees clockwise on screen, top left corner first.
ROTATED = ((87.679492, 31.339746), (122.320508, 51.339746), (112.320508, 68.660254))
ROTATED = (*ROTATED, (77.679492, 48.660254))


@pytest.fixture
def annotations():
    """Six frames of 200x100: a target lost in frames 2 and 3, a rotated one in frames 1 and 2."""
    first = [
        Annotation(frame, frame / 25, 1, (10.0 + frame, 20.5, 30.25, 40.0), None, 0.9, lost)
        for frame, lost in enumerate((False, False, True, True, False, False))
    ]
    second = [
        Annotation(frame, frame / 25, 2, (80.0, 30.0, 40.0, 40.0), ROTATED, 0.12345)
        for frame in (2, 1)
    ]
    return Annotations((200, 100), 25.0, ('boat & "<crew>"', "boat 2"), (*second, *first))
