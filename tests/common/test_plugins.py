import pytest

from viewbench.common import plugins
from viewbench.common.errors import UserError

PACKAGES = ["selectors", "backends", "reports", "scenes.formats", "scenes.encoders", "workflow.commands"]


@pytest.mark.parametrize("package", PACKAGES)
def test_every_plugin_has_a_summary_and_imports(package):
    found = plugins.names(package)
    assert found == sorted(found)
    assert found
    for name in found:
        assert not name.startswith("_")
        assert len(plugins.summary(package, name)) > 10, f"{package}/{name} needs a docstring"
        assert plugins.load(package, name).__doc__


def test_an_unknown_name_is_answered_with_the_nearest():
    with pytest.raises(UserError, match="did you mean 'maxmin'"):
        plugins.load("selectors", "maxmim")


def test_constants_are_read_without_importing():
    for name in plugins.names("selectors"):
        module = plugins.load("selectors", name)
        for variable in ("SEEDED", "FACTORS", "PARAMETERS"):
            assert plugins.constant("selectors", name, variable) == getattr(module, variable)


def test_functions_are_found_without_importing():
    found = {name: plugins.defines("selectors", name, "warm") for name in plugins.names("selectors")}
    assert found == {name: hasattr(plugins.load("selectors", name), "warm") for name in found}
    assert [name for name in found if found[name]] == ["coverage"]
    assert not plugins.defines("selectors", "nothing", "warm")
