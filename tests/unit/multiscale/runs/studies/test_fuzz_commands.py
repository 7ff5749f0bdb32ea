"""Comparisons of any scenes, and command lines of any words, end in order or in one line."""

from hypothesis import HealthCheck, given, settings

from benchmarks.command_words import called, lines
from benchmarks.compared_inputs import asked, compared
from benchmarks.scene_inputs import BASE, toml

few = settings(
    derandomize=True, database=None, deadline=None, suppress_health_check=list(HealthCheck)
)


@settings(few, max_examples=8)
@given(asked)
def test_comparisons_of_any_scenes(tmp_path_factory, drawn):
    path = tmp_path_factory.getbasetemp() / "compared.toml"
    path.write_text(toml(drawn[0]), encoding="utf-8", errors="surrogatepass")
    compared(path, *drawn[1:])


@settings(few, max_examples=10)
@given(lines)
def test_command_lines_of_any_words(tmp_path_factory, words):
    path = tmp_path_factory.getbasetemp() / "called.toml"
    path.write_text(toml(BASE), encoding="utf-8")
    called(path, words)
