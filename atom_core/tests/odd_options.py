"""Options of commands with values that nobody means, drawn by Hypothesis."""

from damage import NAMES, NUMBERS
from hypothesis import strategies as st

# As they can be typed and printed; what is written stays below the folder that is worked in.
WORDS = [name for name in NAMES if not {"\0", "\ud800"} & set(name) and not name.startswith("/")]
WORDS += ["rgb_1", "lidar_1", "rgb_1,depth_1", "000", "001", "pattern_1", "world", "*", "[", "all"]
WORDS += ["lambda x: x", "lambda x: 1%0", "data", "data/dataset.json", "out", "0.1 0.2", "1e999"]
VALUES = st.one_of(
    *(st.sampled_from(WORDS), st.sampled_from(NUMBERS).map(str), st.text("a%-{", max_size=4))
)
_FEWEST = {"+": 1, "*": 0, "?": 0, None: 1}


def command_line(draw, options, usual):
    """Draw words: of most options that a run needs what is usual, of up to four others anything.

    Args:
        draw: Hypothesis's function.
        options: of argparse.
        usual: returns the value that an option mostly has, None of those that are left out.
    """
    words, rest = [], []
    for option in options:
        value = usual(option)
        if value is not None and draw(st.integers(0, 9)):
            words += [*option.option_strings[:1], value]
        elif option.required and draw(st.integers(0, 9)):
            words += _with_values(draw, option)
        else:
            rest.append(option)
    chosen = draw(st.lists(st.sampled_from(rest), max_size=4)) if rest else []
    return words + [word for option in chosen for word in _with_values(draw, option)]


def _with_values(draw, option):
    """Draw the words of an option: its name, and as many values as it takes."""
    count = option.nargs
    if not isinstance(count, int):
        count = draw(st.integers(_FEWEST[count], 1 if count in (None, "?") else 3))
    usual = st.sampled_from([str(choice) for choice in option.choices or ["1"]])
    values = [draw(st.one_of(usual, VALUES)) for _ in range(count)]
    return [*option.option_strings[:1], *values]
