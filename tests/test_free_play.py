"""Free play: its predictions, in a JavaScript engine, are those of `predict`."""

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from support.javascript import Script
from support.runs import tries

from helpers.recording import predict

GLUE = 'const played = values => stories(predicted(values), 41);'
numbers = st.tuples(
    st.integers(1, 50),  # hundredths of a second, as the sliders have them
    st.integers(1, 100),
    st.integers(1, 41),
    st.integers(1, 10),
    st.booleans(),
)


@pytest.fixture(scope='module')
def script():
    return Script('stories.js', 'predicted.js', glue=GLUE)


@tries(260)
@given(numbers)
@example((5, 20, 10, 1, True))
@example((5, 20, 10, 4, False))
def test_what_is_drawn_is_the_prediction(script, drawn):
    period, callback, depth, threads, exclusive = drawn
    given_ = {'period': period / 100, 'callback': callback / 100, 'depth': depth}
    given_ |= {'threads': threads}
    messages = script.call('played', given_ | {'exclusive': exclusive})
    table = predict(period / 100, callback / 100, depth, 1 if exclusive else threads, 41)
    started = [None if 'by' in one else one['left'] for one in messages]
    assert [at is None for at in started] == table['started_s'].isna().tolist()
    assert [at for at in started if at is not None] == pytest.approx(
        table['started_s'].dropna().tolist()
    )
    heard = table['started_s'].notna().sum()
    assert script.call('told', messages).startswith(f'{heard} of 41 messages are received.')
