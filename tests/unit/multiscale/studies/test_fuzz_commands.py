"""Comparisons of any scenes, and command lines of any words, end in order or in one line."""

from helpers.command_words import called, lines
from helpers.compared_inputs import asked, compared
from helpers.scene_inputs import BASE, toml
from hypothesis import HealthCheck, given, settings
from multiscale.comparison.configuration import Configuration, RunResult, read_result, write_result

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


def test_a_damaged_file_is_no_result(tmp_path):
    one = Configuration(name="one", content={}, cost=1.0)
    result = RunResult(configuration=one, status="done", start_s=0.25)
    path = write_result(tmp_path / "a.json", result)
    whole = path.read_text(encoding="utf-8")
    assert read_result(path).start_s == 0.25
    for damaged in (whole.replace("0.25", "0.35"), whole[:-9], "[" * 10**5, "{}", '"sha256"', ""):
        path.write_text(damaged, encoding="utf-8")
        assert read_result(path) is None
    path.write_text(whole.partition("\n")[2], encoding="utf-8")
    assert read_result(path) is None
