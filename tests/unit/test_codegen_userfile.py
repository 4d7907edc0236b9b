"""Energies in a user's own file: found by name, declared next to the function, refused in one line."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import pytest

from codegen import energy
from codegen.declare import Declaration, declaration
from codegen.errors import CodegenError
from codegen.trace import trace
from codegen.userfile import as_density, load_density
from tmc_vem.energy import DENSITIES, densities

MY_REGULARISER = '''
"""A few lines, as a user writes them."""
from codegen import energy
from neighbour import half

@energy(parameters={"kappa": 0.1, "length": None})
def bending(F, G, p, m):
    """Squared Laplacian.

    More words."""
    return half * p.kappa * p.length**2 * sum((G[i][0][0] + G[i][1][1])**2 for i in (0, 1))

def plain(F, G, p, m):
    return p.kappa * G[0][0][0] ** 2

def three(F, G, p):
    return F[0][0]

number = 3.0
'''


@pytest.fixture
def directory(tmp_path, monkeypatch):
    (tmp_path / "my_reg.py").write_text(MY_REGULARISER)
    (tmp_path / "neighbour.py").write_text("half = 0.5\n")
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    sys.modules.pop("neighbour", None)


def test_a_decorated_function(directory):
    loaded = load_density("my_reg.py:bending")
    assert loaded.name == "bending"
    assert loaded.description == "Squared Laplacian."
    assert loaded.parameters == {"kappa": 0.1, "length": None}
    traced = trace(loaded.integrand)
    assert traced.parameters == ("kappa", "length")
    assert "G" in traced.used
    assert load_density(f"{directory}/my_reg.py:bending").name == "bending"
    assert str(directory) not in sys.path


def test_values_from_outside(directory):
    assert load_density("my_reg.py:bending").with_values({"length": 2}).parameters == {"kappa": 0.1, "length": 2.0}
    assert load_density("my_reg.py:plain").with_values({"kappa": 3}).parameters == {"kappa": 3.0}
    with pytest.raises(CodegenError, match="'bending' has no parameter 'kapa': its parameters are kappa, length"):
        load_density("my_reg.py:bending").with_values({"kapa": 1.0})


def test_import_paths_and_objects_with_a_density():
    loaded = load_density("tmc_vem.energy:medium_angle_damped")
    assert loaded.function is DENSITIES["medium_angle_damped"].density
    assert loaded.parameters == dict.fromkeys(("mu", "gamma", "alpha_r", "beta"))
    assert "regulariser angle (15)" in loaded.description
    assert load_density("tmc_vem.energy.densities:angle").function is densities.angle
    assert not load_density("tmc_vem.energy:medium_tangent").declared.objective


def test_a_function_from_an_interactive_session():
    loaded = as_density(lambda F, G, p, m: F[0][0])
    assert loaded.name == "<lambda>"
    assert loaded.parameters == {}
    with pytest.raises(CodegenError, match=r"^'energy' is of type int, not a function energy\(F, G, p, m\)$"):
        as_density(3)


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("my_reg.py", r"'my_reg.py' names no energy: write FILE.py:FUNCTION or package.module:FUNCTION"),
        ("my_reg.py:", "names no energy"),
        ("none.py:bending", "there is no file none.py"),
        ("my_reg.py:bendin", "my_reg.py has no 'bendin'; it has bending, plain, three"),
        ("my_reg.py:number", r"my_reg.py: 'number' is of type float, not a function number\(F, G, p, m\)"),
        ("my_reg.py:three", r"my_reg.py: 'three\(F, G, p\)' does not take \(F, G, p, m\); give it these four"),
        ("no.such.module:bending", "there is no module 'no.such.module'; a file is written FILE.py:FUNCTION"),
        ("syntax.py:bending", r"syntax.py, line 2: "),
        ("raises.py:bending", "raises.py does not run: ZeroDivisionError: division by zero"),
        ("imports.py:bending", "imports.py does not run: ModuleNotFoundError: No module named 'nowhere'"),
        ("declared.py:bending", "energy 'bending': unknown declaration 'objectiv'; known are parameters, objective"),
        ("rotation.py:bending", r"energy 'bending': max_rotation is 200; give degrees in \(10, 180\]"),
        ("names.py:bending", r"energy 'bending': declare parameters with their values, like {'kappa': 1.0}"),
        ("directory.py:bending", "there is no file directory.py"),
        ("empty.py:bending", "empty.py has no 'bending'; it has no functions"),
    ],
)
def test_what_is_wrong_with_a_name_or_a_file_is_said_in_one_line(directory, target, message):
    (directory / "syntax.py").write_text("def bending(F, G, p, m):\nreturn 1\n")
    (directory / "raises.py").write_text("1 / 0\n")
    (directory / "imports.py").write_text("import nowhere\n")
    function = "def bending(F, G, p, m):\n    return F[0][0]\n"
    (directory / "declared.py").write_text(function + "bending.declared = {'objectiv': True}\n")
    (directory / "rotation.py").write_text(function + "bending.declared = {'max_rotation': 200}\n")
    (directory / "names.py").write_text(function + "bending.declared = {'parameters': ['kappa']}\n")
    (directory / "directory.py").mkdir()
    (directory / "empty.py").write_text("")
    with pytest.raises(CodegenError, match=message) as caught:
        load_density(target)
    assert "\n" not in str(caught.value)


def test_the_decorator_and_the_plain_dictionary_say_the_same():
    @energy(parameters={"kappa": 1.0}, objective=False, max_rotation=80.0)
    def one(F, G, p, m):
        return F[0][0]

    def two(F, G, p, m):
        return F[0][0]

    two.declared = {"parameters": {"kappa": 1.0}, "objective": False, "max_rotation": 80.0}
    assert declaration(one) == declaration(two) == Declaration({"kappa": 1.0}, objective=False, max_rotation=80.0)
    assert declaration(SimpleNamespace(), "nothing") == Declaration()
