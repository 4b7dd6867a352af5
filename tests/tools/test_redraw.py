"""Outputs get the scripts of today, or are left as they are."""

import pytest

from helpers.replay import level, script
from tools.lessons.redraw import redrawn


def test_an_output_of_today_stays():
    html = level('deadlock').html()
    assert redrawn(html) == html


def test_a_file_that_has_grown_too_much_is_not_left_out():
    old = f'<div class="replay level"><script>{script("model.js")[:-5]}'
    old += 'function circleOf(setup,state){}\n})();</script></div>'
    with pytest.raises(ValueError, match=r'it would lose .*circleOf.*: run the lesson'):
        redrawn(old)
