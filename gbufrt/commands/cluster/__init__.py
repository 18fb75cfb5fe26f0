"""Work spread over processes and machines by Ray. Only this room imports it, and only when there is work.

Work is a generator function of an installed module, called as ``work(shared, task, folder)`` in a worker process. It
writes files into ``folder``, which is temporary, and yields a value after every step. What it has written by then
travels with the value, as the machine that reads the results may share no disk with the worker.
"""
