"""The colours of look.css, computed as WCAG 2 has it: for readers with weak eyes, and beamers."""

from helpers.notebook import LOOK

WHITE, DARK = '#ffffff', '#131416'  # the ground of pages, light and dark
LETTERS, MARKS = 4.5, 3.0


def luminance(colour):
    parts = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    red, green, blue = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def contrast(one, other):
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def test_colours_are_clear_in_light_and_in_dark():
    assert contrast('#000000', '#ffffff') == 21
    for name in ('heard', 'lost', 'waiting', 'robot', 'ink'):
        assert contrast(LOOK[name], WHITE) >= LETTERS, name
        assert contrast(LOOK[name], DARK) >= MARKS, name


def test_black_letters_are_clear_on_a_note():
    assert contrast(LOOK['note'], '#000000') >= LETTERS
