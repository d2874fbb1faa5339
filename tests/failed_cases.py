"""Print which cases of gtest and rostest failed, from the XML files that catkin's tests leave.

ctest prints all output of a test that failed, thousands of lines where a robot is played; this
is what one needs first, so `make test` ends with it.
"""

import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

LINES = 12  # of a case's message: its end, where an exception stands


def failures(folder):
    """Yield (case, message) of every case that failed or could not be read."""
    for path in sorted(Path(folder).rglob("*.xml")):
        try:
            root = ElementTree.parse(path).getroot()
        except ElementTree.ParseError as error:
            yield path.name, f"not readable: {error}"
            continue
        for case in root.iter("testcase"):
            for outcome in (*case.findall("failure"), *case.findall("error")):
                words = (outcome.text or outcome.get("message") or "").strip()
                yield f"{path.stem}: {case.get('name')}", words


def main():
    for case, message in failures(sys.argv[1]):
        print(f"FAILED {case}")
        for line in message.splitlines()[-LINES:]:
            print(f"    {line}")


if __name__ == "__main__":
    main()
