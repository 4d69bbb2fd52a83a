"""Help of commands that take a scene: `warp-pd run SCENE --help` lists the arguments of the scene."""

from __future__ import annotations

import inspect
from typing import Any

import click

from .scene_files import load_scene

# Arguments that mean the same in every scene; a scene says otherwise under "Args:" of its `build`.
COMMON = {
    "critical_stretch": "Stretch at which bonds break, instead of the tearing energy [-].",
    "damping": "Mass damping [1/s].",
    "density": "Density [kg/m^3].",
    "depth": "Distance by which the body is pushed down [m].",
    "duration": "Simulated time [s].",
    "force": "Force law; see --force above.",
    "frames": "Number of frames after the first.",
    "friction": "Coefficient of friction [-].",
    "horizon": "Horizon in spacings.",
    "jitter": "Random in-plane perturbation of the points, in spacings.",
    "load_steps": "Number of load steps.",
    "most_iterations": "Largest number of Newton iterations in a load step.",
    "overload": "Final energy release rate divided by the tearing energy [-].",
    "points": "Points along x.",
    "pressure": "Pressure [Pa].",
    "roughness": "Height of the initial random bumps, in spacings.",
    "safety": "Time step over the estimated stable one; None: 0.9, and 0.5 for bonds that can break or slack sheets.",
    "seed": "Seed of the random numbers.",
    "self_contact": "Whether to include contact of the sheet with itself.",
    "solver": "Solver: explicit, relaxation or newton, if the scene supports it.",
    "speed": "Speed of the moving support or body [m/s].",
    "stretch": "Final stretch [-].",
    "tearing_energy": "Tearing energy per torn area [J/m^2].",
    "tolerance": (
        "Unbalanced force relative to loads and reactions at which equilibrium is accepted; None: the solver's default."
    ),
    "turn": "Rotation of the grid [degrees].",
    "weights": "Weights of the force law: published, plain, corrected or auto.",
    "areas": "Areas of points on edges: whole, shared, or auto, whole with published weights.",
    "wrinkles": (
        "relaxed: wrinkles are finer than the spacing and the sheet carries no compression; resolved: it carries "
        "compression."
    ),
}


class SceneCommand(click.Command):
    """A command whose help lists the arguments of the given scene."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Store the name of the scene before click handles --help."""
        if any(option in args for option in ctx.help_option_names):
            named = self.make_parser(ctx).parse_args(args=list(args))[0].get("scene")
            ctx.meta[__name__] = named if isinstance(named, str) else None
        return super().parse_args(ctx, args)

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Append the arguments of the scene to the help."""
        scene = ctx.meta.get(__name__)
        if scene is None:
            with formatter.section("Arguments of a scene"):
                formatter.write_text(f"{ctx.command_path} SCENE --help lists them.")
            return
        module = load_scene(scene)
        with formatter.section(f"Arguments of {scene}, as --set NAME=VALUE"):
            formatter.write_dl(scene_arguments(module))
        title, _, text = (inspect.getdoc(module) or "").partition("\n")
        formatter.write_paragraph()
        for paragraph in (title, *text.strip().split("\n\n")):
            formatter.write_text(paragraph)
            formatter.write_paragraph()


def scene_arguments(module: Any) -> list[tuple[str, str]]:
    """Arguments of a scene's `build` with type, default and description (empty if there is none)."""
    prose = [inspect.getdoc(module.build) or "", inspect.getdoc(module) or ""]
    said = _said_under_args(prose[0])
    rows: list[tuple[str, str]] = []
    for name, parameter in inspect.signature(module.build).parameters.items():
        common = COMMON.get(name, "")
        if parameter.default is not None:
            common, without, _ = common.partition("; None: ")
            common += "." if without else ""
        rows.append((str(parameter).replace("'", ""), said.get(name) or _sentence(name, prose) or common))
    return rows


def _said_under_args(docstring: str) -> dict[str, str]:
    """The entries of the section "Args:" of a docstring, by name."""
    _, _, section = docstring.partition("Args:\n")
    found: dict[str, str] = {}
    name = ""
    for line in section.splitlines():
        text = line.strip()
        indent = len(line) - len(line.lstrip())
        key, entry, rest = text.partition(": ")
        if indent == 4 and entry and key.isidentifier():
            name, found[key] = key, rest.strip()
        elif indent > 4 and name:
            found[name] += f" {text}"
        elif text:
            break
    return found


def _sentence(name: str, texts: list[str]) -> str:
    """The first sentence that begins with the argument in backticks; "" if there is none."""
    for text in texts:
        words = " ".join(text.split())
        at = words.find(f"`{name}`")
        while at >= 0:
            if at == 0 or words[at - 2 : at] in (". ", ": ", "; "):
                sentence, _, _ = words[at:].partition(". ")
                return f"{sentence.removesuffix('.')}."
            at = words.find(f"`{name}`", at + 1)
    return ""
