"""The demo's exit code: what stops it, what does not. The programs it calls are stand-ins here."""

import json

import pytest

from atom_examples import demo, demo_steps

STEPS = ["simulate", "simulate", "collect", "collect", "check", "calibrate", "evaluate"]
STEPS += ["report"]


@pytest.fixture
def play(monkeypatch, tmp_path, capsys):
    """Return a function: exit codes by step -> the demo's exit code, the steps done, stderr."""

    def run(*more, **codes):
        done = []

        def stand_in(name):
            def program(words):
                step = name or words[0]
                done.append(step)
                if step == "evaluate":
                    folder = tmp_path / "out" / "evaluation"
                    folder.mkdir(exist_ok=True)
                    mean = {"translation_error_m": 0.001, "rotation_error_deg": 0.02}
                    document = json.dumps({"ground_truth": {"mean": mean}})
                    (folder / "evaluation.json").write_text(document)
                return codes.get(step, 0)

            return program

        monkeypatch.setattr(demo.cell_simulator, "main", stand_in("simulate"))
        monkeypatch.setattr(demo.collect_from_bag, "main", stand_in("collect"))
        monkeypatch.setattr(demo_steps.cli, "main", stand_in(None))
        code = demo.main(["--output", str(tmp_path / "out"), *more])
        return code, done, capsys.readouterr()

    return run


def test_all_steps_are_done_and_the_errors_said(play):
    code, done, said = play()
    assert (code, done) == (0, STEPS)
    assert "1.00 mm and 0.020 deg" in said.out


@pytest.mark.parametrize("step", ["collect", "check"])
def test_a_moment_or_a_sensor_that_gave_nothing_is_no_reason_to_stop(play, step):
    assert play(**{step: 1})[:2] == (0, STEPS)


@pytest.mark.parametrize("step", ["calibrate", "evaluate"])
def test_an_answer_that_is_not_acceptable_is_exit_code_1(play, step):
    assert play(**{step: 1})[:2] == (1, STEPS)


@pytest.mark.parametrize("step", dict.fromkeys(STEPS))
def test_a_refusal_ends_the_demo(play, step):
    code, done, said = play(**{step: 2})
    assert code == 2 and done == STEPS[: STEPS.index(step) + 1]
    assert len([line for line in said.err.splitlines() if line.startswith("demo: ")]) == 1


def test_an_interruption_ends_the_demo(play):
    code, done, _ = play(collect=130)
    assert code == 130 and done[-1] == "collect"


def test_earlier_results_are_replaced_only_when_told(play):
    assert play()[0] == 0
    code, done, said = play()
    assert code == 2 and done == [] and "--overwrite" in said.err
    assert play("--overwrite")[0] == 0
