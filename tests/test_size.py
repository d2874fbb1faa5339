"""Functions fit a screen, and modules stay small."""

import ast
import re
import subprocess
import sys
from pathlib import Path
from typing import Iterator, NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from python_statements import statements  # noqa: E402

MODULE_LINES = 450
FUNCTION_LINES = {"Python": 50, "C++": 60}


class Function(NamedTuple):
    """A function of a file, from its name (decorators aside) to its end."""

    name: str
    lines: int


def sources(pattern):
    names = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    ).stdout.split("\0")
    if names == [""]:
        pytest.skip("not a git checkout")
    return sorted(ROOT / n for n in names if re.search(pattern, n) and (ROOT / n).is_file())


def of_python():
    return sources(r"\.py$|(^|/)scripts/\w+$")


def of_cpp():
    return sources(r"\.(cpp|h)$")


def python_functions(text) -> Iterator[Function]:
    for node in statements(text):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            yield Function(node.name, node.end_lineno - node.lineno + 1)


def cpp_functions(text) -> Iterator[Function]:
    """Find what has a parameter list before its braces and is in no other function.

    Classes and namespaces are looked into; braces of initialisers, also of members, are not
    functions, and what is inside a function, such as a lambda, belongs to it.
    """
    text = bare(text)
    begin, braces = 0, []  # of the statement; "scope", "function" or "inside" for each open one
    for match in re.finditer(r"[{};]", text):
        at, sign = match.start(), match.group()
        looked_into = not braces or braces[-1] == "scope"
        if sign == "{":
            header = text[begin:at].strip()
            braces.append(kind_of(header) if looked_into else "inside")
            if braces[-1] == "scope":
                begin = at + 1
        elif sign == "}":
            closed = braces.pop()
            # What follows a member's initialiser is the next one, or the function's own brace.
            of_member = closed == "function" and text[at + 1 :].lstrip()[:1] in (",", "{")
            if closed == "function" and not of_member:
                start = at - len(text[begin:at].lstrip())
                name = re.search(r"([\w~:<>]+)\s*\(", text[start:at]).group(1)
                yield Function(name, text.count("\n", start, at) + 1)
            if closed != "inside" and not of_member:
                begin = at + 1
        elif looked_into:
            begin = at + 1


def kind_of(header):
    """Return what a brace opens, by the text before it since the last statement."""
    if re.match(r"(class|struct|enum|union|namespace|extern)\b", header):
        return "scope"
    return "function" if ")" in header and not re.match(r"[^()]*=", header) else "inside"


def bare(text):
    """Return C++ without comments, texts, preprocessor and template heads; lines stay."""

    def newlines(match):
        return "\n" * match.group().count("\n")

    text = re.sub(r"//[^\n]*|/\*.*?\*/", newlines, text, flags=re.DOTALL)
    text = re.sub(r"\"(\\.|[^\"\\\n])*\"|'(\\.|[^'\\\n])+'", "0", text)
    text = re.sub(r"^[ \t]*#(\\\n|[^\n])*", newlines, text, flags=re.MULTILINE)
    text = re.sub(r"\boperator\s*[^\s\w(]+", "operator_", text)
    return re.sub(r"\btemplate\s*<(<[^<>]*>|[^<>])*>", newlines, text)


def name_of(path):
    return str(path.relative_to(ROOT))


def long_functions(paths, functions, limit):
    """Return place -> lines of the functions beyond a limit."""
    found = {}
    for path in paths:
        for function in functions(path.read_text(encoding="utf-8")):
            if function.lines > limit:
                place = f"{name_of(path)}: {function.name}"
                found[place] = max(function.lines, found.get(place, 0))
    return found


def long_modules(paths):
    lines = {name_of(p): len(p.read_text(encoding="utf-8").splitlines()) for p in paths}
    return {name: count for name, count in lines.items() if count > MODULE_LINES}


def test_functions_of_python_fit_a_screen():
    assert not long_functions(of_python(), python_functions, FUNCTION_LINES["Python"])


def test_functions_of_cpp_fit_a_screen():
    assert not long_functions(of_cpp(), cpp_functions, FUNCTION_LINES["C++"])


def test_modules_are_small():
    assert not long_modules([*of_python(), *of_cpp()])


# ---- what counts


CPP = """
namespace a {
// int comment() {
struct S {
  int x{3};
  explicit S(int a) : x{a},
                      y(a) {
    auto f = [&](int b) { return b; };
    if (a) {
    }
  }
  int get() const { return x; }
};
const std::vector<int> kValues = {1, 2};
template <typename T, int N = f(3)>
std::vector<int> long_one(const T& t,
                          int n) {
  const char* text = "} {";
  for (int i = 0; i < n; ++i) {
  }
  return {1, 2};
}
}  // namespace a
"""


def test_functions_of_cpp_are_told_apart():
    found = list(cpp_functions(CPP))
    assert found == [Function("S", 6), Function("get", 1), Function("long_one", 7)]


def test_functions_of_python_are_counted_from_their_name_to_their_end():
    text = "@decorated\ndef f(\n    a,\n):\n    def g():\n        pass\n\n    return g\n"
    assert sorted(python_functions(text)) == [Function("f", 7), Function("g", 2)]
