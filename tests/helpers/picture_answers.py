"""What the script of a picture found as it drew, which the picture's file says."""

from pathlib import Path

from PIL import Image

PICTURES = Path(__file__).parents[2] / "demos" / "pictures"


def answer_of(path):
    """Return what a PNG file says its script found; None where it says nothing."""
    with Image.open(path) as image:
        return image.text.get("answer")


def still_found(picture):
    """Check that a picture that was drawn again says the same as the one that pages show."""
    answer = answer_of(picture)
    assert answer
    assert answer == answer_of(PICTURES / picture.name)
