"""`wbmpc validate` and `wbmpc schema`: scenario files without running them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from wbmpc.commands.exits import ExitCode, say_bad_input
from wbmpc.errors import WbmpcError
from wbmpc.scenario import load_scenario, scenario_json_schema


def validate(paths: Sequence[Path]) -> ExitCode:
    """Say of every file whether it is a valid scenario; all of them are read, whatever the first one is."""
    code = ExitCode.PASSED
    for path in paths:
        try:
            load_scenario(path)
        except WbmpcError as error:
            say_bad_input(error)
            code = ExitCode.BAD_INPUT
        else:
            print(f"{path}: valid")
    return code


def schema() -> ExitCode:
    """Print the JSON Schema of scenario files."""
    print(json.dumps(scenario_json_schema(), indent=2))
    return ExitCode.PASSED
