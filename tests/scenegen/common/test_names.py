"""Unknown names are refused with those that are spelled alike."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenegen.common.errors import BackendError, SpecError
from scenegen.common.names import check_choice, did_you_mean

NAMES = ("shapes", "shapenet", "views")


def test_an_unknown_name_is_refused_and_one_that_is_like_it_told():
    check_choice("preset", "views", NAMES)
    for error in (SpecError, BackendError):
        with pytest.raises(error) as caught:
            check_choice("preset", "Shapenett", NAMES, error)
        assert (caught.value.where, caught.value.expected) == (
            "preset",
            f"one of {', '.join(NAMES)}",
        )
        assert "shapenet" in caught.value.hint
    assert did_you_mean("qqq", NAMES) == ""
    keys = ("points_metric", "points_affine_invariant", "depth_metric")
    assert [key in did_you_mean("points", keys) for key in keys] == [True, True, False]


@given(st.text(max_size=100), st.lists(st.text(max_size=9)))
def test_any_text_has_a_hint_of_names_alone(name, names):
    hint = did_you_mean(name, names)
    assert hint == "" or any(other in hint for other in names)
