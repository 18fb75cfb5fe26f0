"""`gbufrt passes`: what a pipeline is made of."""

from __future__ import annotations

from gbufrt.commands.arguments.checks import check_options
from gbufrt.commands.arguments.options import PassOptions


def passes(options: PassOptions | None = None) -> None:
    """List the passes of a pipeline in order: what each reads and writes, and the tunables that --set can change.

    --without takes stages: a whole branch (gi) or a part of it (gi.accumulate). A tunable is named in full or by any
    unambiguous end of its name; a pass that stands there once may go by its own name (gtao.radius). Under each stands
    what it means, and its value in a pass that is made without arguments, where the preset has another.
    """
    check_options(options or PassOptions())

    from rich.console import Console
    from rich.markup import escape
    from rich.padding import Padding
    from rich.table import Table

    from gbufrt.commands.recipe import Recipe

    recipe, console = Recipe.of(options or PassOptions()), Console(highlight=False)
    pipeline = recipe.build()
    console.print(f"preset {recipe.preset}; names in brackets are used where the frame has them")
    kinds = [type(stage) for _, stage in pipeline.passes()]
    for name, stage in pipeline.passes():
        rows = Table.grid(padding=(0, 2))
        optional = [f"({signal})" for signal in sorted(stage.optional)]
        rows.add_row("reads", " ".join([*sorted(stage.reads), *optional]))
        rows.add_row("writes", " ".join(sorted(stage.writes)))
        meanings, alone = stage.meanings(), type(stage)().tunables()
        for key, value in stage.tunables().items():
            rows.add_row("set", escape(f"{name}.{key}={value!r}"))
            other = "" if alone[key] == value else f" ({type(stage).__name__}() has {alone[key]!r})"
            text = escape(meanings[key].replace("`", "") + other)
            rows.add_row("", Padding(text, (0, 0, 0, 4)), style="dim")
        short = type(stage).__name__.lower()
        also = (
            f", {short}.{next(iter(alone))} for short"
            if alone and kinds.count(type(stage)) == 1 and short != name
            else ""
        )
        console.print(f"\n[bold]{name}[/bold]  {type(stage).__name__}{also}")
        console.print(Padding(rows, (0, 0, 0, 4)))
