"""`gbufrt passes`: what a pipeline is made of."""

from __future__ import annotations

from gbufrt.commands.options import PassOptions


def passes(options: PassOptions | None = None) -> None:
    """List the passes of a pipeline in order: what each reads and writes, and the tunables that --set can change.

    Stages are what --without takes, a whole branch (gi) or a part of it (gi.accumulate). Tunables go by their full
    name or by any end of it that fits only one; a pass may go by its own name (gtao.radius).
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table

    from gbufrt.commands.session import Recipe

    recipe = Recipe.of(options or PassOptions())
    table = Table("stage", "pass", "reads", "writes", "tunables", box=box.SIMPLE_HEAD, title=f"preset {recipe.preset}")
    table.title_justify = "left"
    for name, stage in recipe.build().passes():
        reads = [*sorted(stage.reads), *(f"({name})" for name in sorted(stage.optional))]
        tunables = [f"{key}={value!r}" for key, value in stage.tunables().items()]
        cells = (" ".join(reads), " ".join(sorted(stage.writes)), "\n".join(tunables))
        table.add_row(name, type(stage).__name__, *cells)
    console = Console()
    console.print(table)
    console.print("(in brackets: used where the frame has it)", markup=False)
