"""Nothing that renders uses an operation whose bits depend on the processor."""

import ast
from pathlib import Path

import scenegen

# Dr.Jit computes these by approximations that each processor makes in its own way.
APPROXIMATE = {"rsqrt", "normalize", "rcp_approx"}


def test_no_kernel_uses_an_approximate_operation():
    folder = Path(scenegen.__file__).parent / "rendering"
    used = [
        (path.name, node.lineno, node.attr)
        for path in sorted(folder.rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Attribute) and node.attr in APPROXIMATE
    ]
    assert len(list(folder.rglob("*.py"))) > 15
    assert used == []
