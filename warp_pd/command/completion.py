"""Completion of scenes and of their arguments in a shell; no scene is run for it."""

from __future__ import annotations

import ast
import os
from pathlib import Path

import click
from click.shell_completion import CompletionItem, split_arg_string

from .scene_files import scene_file, scene_names


class SceneName(click.types.StringParamType):
    """The name of a scene of the package, or a Python file."""

    name = "scene"

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Names of scenes, and files."""
        names = [CompletionItem(name) for name in scene_names() if name.startswith(incomplete)]
        return [*names, CompletionItem(incomplete, type="file")]


def complete_setting(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Arguments of the scene that is given, with "=" after their names."""
    # Click parses no word of a line that ends with an option without its value, so the words are those of the shell.
    words, names = split_arg_string(os.environ.get("COMP_WORDS", "")), scene_names()
    scene = next((word for word in words if word in names or (word.endswith(".py") and Path(word).is_file())), None)
    if scene is None:
        return []
    return [CompletionItem(f"{name}=") for name in _arguments(scene_file(scene)) if name.startswith(incomplete)]


def _arguments(file: Path) -> list[str]:
    """Names of the arguments of `build`, from the text of a scene's file."""
    try:
        tree = ast.parse(file.read_bytes())
    except (SyntaxError, ValueError):
        return []
    found = [node.args for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == "build"]
    return [argument.arg for node in found for argument in (*node.posonlyargs, *node.args, *node.kwonlyargs)]
