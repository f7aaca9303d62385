"""The cache of compiled kernels, which the jobs of a study share."""

import os
import subprocess
import sys

WARM = "from viewbench.backends import splat; splat.warm()"


def test_two_processes_on_a_cold_cache_do_not_collide(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    both = [
        subprocess.Popen([sys.executable, "-c", WARM], env=environment, stderr=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    for process in both:
        _, errors = process.communicate(timeout=240)
        assert process.returncode == 0, errors
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.nb*")}
    assert before
    subprocess.run([sys.executable, "-c", WARM], env=environment, check=True)
    after = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.nb*")}
    assert after == before, "a third process compiled something anew"


def test_importing_the_backend_does_not_import_numba():
    code = "import sys; from viewbench.backends import splat; splat.available(); print('numba' in sys.modules)"
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "False\n"
