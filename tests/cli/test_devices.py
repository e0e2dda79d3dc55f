"""Options of XLA for processes that start later."""

import os
import signal

import pytest

from sainet.cli import devices
from sainet.runs.interrupts import interrupts_wait, remembered_interrupts

FAST = (
    "--xla_backend_optimization_level=0 --xla_cpu_use_fusion_emitters=false "
    "--xla_cpu_parallel_codegen_split_count=1"
)


@pytest.fixture
def no_flags(monkeypatch):
    monkeypatch.delenv("XLA_FLAGS", raising=False)


def test_processes_that_start_later_compile_fast(no_flags):
    devices.compile_fast_elsewhere()
    assert os.environ["XLA_FLAGS"] == FAST


def test_flags_of_the_user_take_precedence(no_flags, monkeypatch):
    monkeypatch.setenv("XLA_FLAGS", "--xla_dump_to=/tmp/dump")
    devices.compile_fast_elsewhere()
    assert os.environ["XLA_FLAGS"] == "--xla_dump_to=/tmp/dump"


def test_options_that_xla_does_not_know_are_left_out(no_flags, monkeypatch):
    monkeypatch.setattr(devices, "_FAST", {"xla_of_tomorrow": False})
    devices.compile_fast_elsewhere()
    assert "XLA_FLAGS" not in os.environ


def test_ctrl_c_waits_while_jax_is_imported():
    """An exception in the import of native code may end in an abort."""
    begun = []
    with pytest.raises(KeyboardInterrupt), remembered_interrupts():
        with interrupts_wait():
            signal.raise_signal(signal.SIGINT)
            begun.append("the import goes on")
        begun.append("the command")
    assert begun == ["the import goes on"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
