"""Mutation tests: are small faults in the code noticed by the tests? `make mutants` runs it.

Faults ("mutants") are those of Cosmic Ray: another operator, comparison or number, a condition
turned round, a loop left out. There are thousands, so places are drawn by chance, with one mutant
at each. The committed state is cloned into mutants_output/; the tests run there once, with a note
of the lines that each executes. For a mutant, those that execute its line then run (of a constant
or a decorator: the lines that use it), quick ones first, until one fails ("killed"). Mutants that
no test kills are listed with their change.

Usage: mutants.py [--sample N] [--seed N] [--jobs N] [--only PART_OF_A_PATH]
"""

from __future__ import annotations

import argparse
import ast
import difflib
import importlib.util
import json
import os
import queue
import random
import shutil
import subprocess
import sys
from collections import Counter, defaultdict
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import ExitStack
from pathlib import Path
from typing import Dict, Iterator, List, NamedTuple, Tuple

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / ".mutation"))  # Cosmic Ray, behind what the tests use
OUTPUT = ROOT / "mutants_output"
SOURCES = "atom_core/src"
PACKAGES = ("geometry", "problem", "solvers", "evaluation")
TESTS_S = 60.0  # of tests for each mutant, as long as they take without it
# These two put the names of variables in the place of others, and need to be told which.
WITHOUT = {"core/VariableReplacer", "core/VariableInserter"}


class Mutant(NamedTuple):
    """One change; `line` and `column` say where, `which` is the operator's count in the file."""

    path: str
    line: int
    column: int
    operator: str
    which: int


class Tests(NamedTuple):
    """What the tests execute, and how long they take without any mutant."""

    of_line: Dict[Tuple[str, int], List[str]]
    of_module: Dict[str, List[str]]
    seconds: Dict[str, float]


def main() -> int:
    """Draw mutants, run the tests of each, write the survivors; return 0."""
    args = _arguments()
    if importlib.util.find_spec("pytest_cov") is None:
        sys.exit("make mutants: needs python3-pytest-cov: apt-get install python3-pytest-cov")
    shutil.rmtree(OUTPUT, ignore_errors=True)
    copies = [_copy(OUTPUT / f"copy_{number}") for number in range(args.jobs)]
    drawn = _drawn(args)
    tests = _watched(copies[0], args.jobs)
    chosen = {mutant: _tests_of(mutant, tests) for mutant in drawn}
    for mutant, outcome in _outcomes(copies, chosen):
        with (OUTPUT / "outcomes.jsonl").open("a") as stream:
            stream.write(json.dumps({**mutant._asdict(), "outcome": outcome}) + "\n")
    _report(drawn, len(_places(args.only)))
    return 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sample", type=int, default=400, help="mutants drawn")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--only", default="", help="files whose path contains this")
    return parser.parse_args()


def _copy(folder: Path) -> Path:
    """Clone what is committed, with the compiled module of this checkout."""
    subprocess.run(["git", "clone", "--quiet", "--shared", str(ROOT), str(folder)], check=True)
    (folder / ".venv").symlink_to(ROOT / ".venv")
    package = ROOT / "devel/lib/python3/dist-packages/atom_core"
    for module in package.glob("_core*.so"):
        (folder / SOURCES / "atom_core" / module.name).symlink_to(module)
    # Mutants may have the size and the second of the file before: Python is to look at the content.
    compiler = [sys.executable, "-m", "compileall", "-q", "--invalidation-mode", "checked-hash"]
    subprocess.run([*compiler, str(folder / SOURCES)], check=True)
    return folder


def _environment(copy: Path) -> Dict[str, str]:
    ours = [str(copy / SOURCES), str(copy / "atom_calibration" / "src")]
    threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    path = os.pathsep.join([*ours, os.environ.get("PYTHONPATH", "")])
    return {**os.environ, **threads, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"}


def _places(only: str) -> Dict[Tuple[str, int, int], List[Mutant]]:
    """Return all mutants by their place."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.plugins import get_operator, operator_names

    operators = {n: get_operator(n)() for n in sorted(operator_names()) if n not in WITHOUT}
    places: Dict[Tuple[str, int, int], List[Mutant]] = defaultdict(list)
    for package in PACKAGES:
        for file in sorted((ROOT / SOURCES / "atom_core" / package).rglob("*.py")):
            path = str(file.relative_to(ROOT))
            if only not in path:
                continue
            count: Counter = Counter()
            for node in ast_nodes(get_ast(file.read_text("utf-8"))):
                for name, operator in operators.items():
                    for start, _ in operator.mutation_positions(node):
                        places[(path, *start)].append(Mutant(path, *start, name, count[name]))
                        count[name] += 1
    return places


def _drawn(args: argparse.Namespace) -> List[Mutant]:
    chance = random.Random(args.seed)
    places = _places(args.only)
    keys = chance.sample(sorted(places), min(args.sample, len(places)))
    return [chance.choice(places[key]) for key in keys]


def _watched(copy: Path, jobs: int) -> Tests:
    """Run the tests of the core once, and note what each executes."""
    (copy / ".coveragerc").write_text("[run]\nparallel = true\n", "utf-8")
    command = [sys.executable, "-m", "pytest", "-q", "-n", str(jobs), "--dist", "loadfile"]
    command += ["-p", "no:cacheprovider", "-p", "mutant_runner", "-m", "not slow and not long"]
    command += ["--cov-config=.coveragerc", f"--cov={copy / SOURCES / 'atom_core'}"]
    command += ["--cov-context=test", "--cov-report=", "atom_core/tests"]
    environment = _environment(copy)
    environment["PYTHONPATH"] += os.pathsep + str(ROOT / "tests")
    environment["MUTANTS_SECONDS"] = str(OUTPUT / "seconds.json")
    if subprocess.run(command, cwd=copy, env=environment).returncode:
        sys.exit("mutants: the tests fail without any mutant")
    return _noted(copy)


def _noted(copy: Path) -> Tests:
    import coverage

    seconds = json.loads((OUTPUT / "seconds.json").read_text("utf-8"))
    data = coverage.CoverageData(str(copy / ".coverage"))
    data.read()
    of_line: Dict[Tuple[str, int], List[str]] = {}
    of_module: Dict[str, List[str]] = {}
    for file in data.measured_files():
        path = str(Path(file).relative_to(copy))
        lines = data.contexts_by_lineno(file)
        in_module = set()
        for line, contexts in lines.items():
            of_line[path, line] = _with_shared(contexts, seconds)
            in_module.update(of_line[path, line])
        of_module[path] = sorted(in_module)
    return Tests(of_line, of_module, seconds)


def _with_shared(contexts: List[str], seconds: Dict[str, float]) -> List[str]:
    """Return the tests of contexts, and where it was a fixture's, all that may share it."""
    tests = {context.rpartition("|")[0] for context in contexts if context}
    sharing = {c.partition("::")[0] for c in contexts if c.endswith("|setup")}
    tests |= {test for test in seconds if test.partition("::")[0] in sharing}
    return sorted(test for test in tests if test in seconds)


def _tests_of(mutant: Mutant, tests: Tests) -> List[str]:
    """Return the tests for a mutant: those of its package first, then quick ones."""
    found = set(tests.of_line.get((mutant.path, mutant.line), ()))
    for line in _users(mutant):
        found.update(tests.of_line.get((mutant.path, line), ()))
    found = found or set(tests.of_module.get(mutant.path, ()))
    package = Path(mutant.path).parent.name
    ordered = sorted(found, key=lambda t: (f"/{package}/" not in t, tests.seconds[t]))
    kept, total = [], 0.0
    for test in ordered:
        total += tests.seconds[test]
        if total > TESTS_S and kept:
            break
        kept.append(test)
    return kept


def _users(mutant: Mutant) -> List[int]:
    """Return the lines of a decorated function or class, or those that name a constant.

    The line itself is executed when its module is imported, by whichever test comes first.
    """
    lines, names = set(), set()
    tree = ast.parse((ROOT / mutant.path).read_text("utf-8"))
    for node in ast.walk(tree):
        for decorator in getattr(node, "decorator_list", ()):
            if decorator.lineno == mutant.line:
                lines.update(range(node.lineno, node.end_lineno + 1))
        within = node.body if isinstance(node, (ast.Module, ast.ClassDef)) else ()
        for item in within:
            assigns = isinstance(item, (ast.Assign, ast.AnnAssign))
            if assigns and item.lineno <= mutant.line <= item.end_lineno:
                names |= {n.id for n in ast.walk(item) if isinstance(n, ast.Name)}
    for node in ast.walk(tree):
        if (getattr(node, "id", None) or getattr(node, "attr", None)) in names:
            lines.add(node.lineno)
    return sorted(lines)


def _mutated(mutant: Mutant, text: str) -> str:
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    changed = mutate_code(text, get_operator(mutant.operator)(), mutant.which)
    if changed is None:
        raise ValueError(f"no such mutant: {mutant}")
    return str(changed)


def _outcomes(copies: List[Path], chosen: Dict[Mutant, List[str]]) -> Iterator[Tuple[Mutant, str]]:
    """Yield each mutant with its outcome: killed, survived, or not executed by any test."""
    with ExitStack() as stack:
        idle: queue.Queue[_Runner] = queue.Queue()
        for copy in copies:
            idle.put(stack.enter_context(_Runner(copy)))

        def outcome(mutant: Mutant) -> Tuple[Mutant, str]:
            runner = idle.get()
            try:
                return mutant, runner.outcome(mutant, chosen[mutant])
            finally:
                idle.put(runner)

        pool = stack.enter_context(ThreadPoolExecutor(len(copies)))
        done = as_completed([pool.submit(outcome, mutant) for mutant in chosen])
        for number, future in enumerate(done, 1):
            mutant, said = future.result()
            where = f"{mutant.path}:{mutant.line} {mutant.operator}"
            print(f"{number}/{len(chosen)} {said}: {where}", flush=True)
            yield mutant, said


class _Runner:
    """A process with the libraries loaded, which forks for each mutant."""

    def __init__(self, copy: Path):
        self._copy = copy

    def __enter__(self) -> _Runner:
        self._process = subprocess.Popen(
            [sys.executable, str(ROOT / "tests" / "mutant_runner.py")],
            cwd=self._copy,
            env=_environment(self._copy),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        return self

    def __exit__(self, *_) -> None:
        self._process.stdin.close()
        self._process.wait()

    def outcome(self, mutant: Mutant, tests: List[str]) -> str:
        if not tests:
            return "not executed"
        file = self._copy / mutant.path
        text = file.read_text("utf-8")
        file.write_text(_mutated(mutant, text), "utf-8")
        try:
            code = self._run(tests)
        finally:
            file.write_text(text, "utf-8")
        # Where the mutant keeps tests from being collected; without it they must be.
        if code not in (0, 1, -1) and self._run(["--collect-only", *tests]) != 0:
            return "tests fail without it"
        return "killed" if code else "survived"

    def _run(self, tests: List[str]) -> int:
        self._process.stdin.write(json.dumps(tests) + "\n")
        self._process.stdin.flush()
        return int(self._process.stdout.readline())


def _report(drawn: List[Mutant], places: int) -> None:
    lines = (OUTPUT / "outcomes.jsonl").read_text("utf-8").splitlines()
    outcomes = {
        Mutant(**{k: v for k, v in o.items() if k != "outcome"}): o["outcome"]
        for o in map(json.loads, lines)
    }
    with (OUTPUT / "survivors.txt").open("w") as stream:
        for mutant in sorted(drawn):
            if outcomes[mutant] != "killed":
                stream.write(f"{outcomes[mutant]}: {mutant.operator}\n{_change(mutant)}\n\n")
    print(f"\n{len(drawn)} of {places} places, one mutant each\n")
    print("| package | mutants | killed | survived | not executed | share killed |")
    print("|---|---|---|---|---|---|")
    for package in (*PACKAGES, ""):
        count = Counter(o for m, o in outcomes.items() if f"/atom_core/{package}" in m.path)
        total = sum(count.values())
        if total:
            row = (count["killed"], count["survived"], count["not executed"])
            share = f"{100 * count['killed'] / total:.0f} %"
            print("|", " | ".join(map(str, (package or "all", total, *row, share))), "|")


def _change(mutant: Mutant) -> str:
    text = (ROOT / mutant.path).read_text("utf-8")
    pair = (text.splitlines(), _mutated(mutant, text).splitlines())
    return "\n".join(difflib.unified_diff(*pair, mutant.path, mutant.path, lineterm="", n=1))


if __name__ == "__main__":
    sys.exit(main())
