"""What a runner holds in memory."""

from typing import Any

from gbufrt import Frame, Pipeline, TemporalPass
from gbufrt.commands.session import Runner
from gbufrt.specimen import specimen


def test_a_runner_lets_go_of_a_state_when_it_is_read() -> None:
    held = []

    class Count(TemporalPass):
        def forward(self, frame: Frame, state: Any = None) -> tuple[Frame, Any]:
            held.append((state, runner.state))
            return frame, (0 if state is None else state) + 1

    runner = Runner(Pipeline(count=Count()), warmup=0)
    still = specimen().still()
    for index in range(3):
        runner(still.replace(index=index))
    assert held == [(None, None), (1, None), (2, None)]
