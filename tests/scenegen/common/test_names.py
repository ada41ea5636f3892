"""Unknown names are refused with those that are spelled alike."""

from hypothesis import given
from hypothesis import strategies as st

from scenegen.common.names import did_you_mean


@given(st.text(max_size=100), st.lists(st.text(max_size=9)))
def test_any_text_has_a_hint_of_names_alone(name, names):
    hint = did_you_mean(name, names)
    assert hint == "" or any(other in hint for other in names)
