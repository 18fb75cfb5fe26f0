import subprocess
import sys

RUN = """
import sys, torch
from gbufrt.compute.operators import operator

@operator("gbufrt_tests::doubled")
def doubled(x: torch.Tensor) -> torch.Tensor:
    return x * 2

@doubled.register_fake
def _(x):
    return torch.empty_like(x)

before = doubled(torch.ones(3)).tolist()
print(before, "torch._dynamo" in sys.modules)
"""
PASSES = """
import sys
from gbufrt.specimen import specimen
from post import me1
me1("low")(specimen())
print("torch._dynamo" in sys.modules)
"""
COMPILED = """
squared = torch.compile(lambda x: doubled(x) + 1, backend="eager", fullgraph=True)
print(squared(torch.ones(3)).tolist(), doubled(torch.ones(3)).tolist())
torch.library.opcheck(doubled, (torch.ones(3),), test_utils=("test_schema", "test_faketensor"))
"""


def test_an_operator_loads_no_compiler_of_torch() -> None:
    assert _printed(RUN) == ["[2.0, 2.0, 2.0] False"]


def test_neither_does_a_pipeline() -> None:
    assert _printed(PASSES) == ["False"]


def test_torch_compiles_around_an_operator() -> None:
    assert _printed(RUN + COMPILED)[1:] == ["[3.0, 3.0, 3.0] [2.0, 2.0, 2.0]"]


def _printed(program: str) -> list[str]:
    command = [sys.executable, "-W", "ignore", "-c", program]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
