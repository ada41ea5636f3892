"""Values in memory are those used last."""

from scenegen.common.recent import Recent


def test_values_used_last_are_kept() -> None:
    recent: Recent[str] = Recent(3)
    for key in "abc":
        recent.put(key, key.upper(), 1)
    recent.put("c", "new", 1)
    assert [recent.get(key) for key in "abcd"] == ["A", "B", "new", None]
    recent.get("a")
    recent.put("d", "D", 1)
    assert [recent.get(key) for key in "abcd"] == ["A", None, "new", "D"]
    recent.put("large", "L", 100)
    assert [recent.get(key) for key in ("a", "c", "d", "large")] == [None, None, None, "L"]
